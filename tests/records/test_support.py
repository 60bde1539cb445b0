"""Recent inspections and alarms in a support bundle."""

import json
import zipfile

from click.testing import CliRunner

from station.commands.support import support


def test_recent_inspections_and_alarms_are_in_it(opened, scenario, trigger, passed, folder, tmp_path):
    async def steps():
        async with opened() as records:
            numbers = [await records.begin(trigger) for _ in range(3)]
            for number in numbers:
                await records.conclude(number, passed)
            return numbers

    numbers = scenario(steps)
    target = tmp_path / "support.zip"
    done = CliRunner().invoke(support, ["--out", str(target)], env={"STATION_HOME": str(folder.parent)})
    assert done.exit_code == 0, done.output
    with zipfile.ZipFile(target) as archive:
        inspections = archive.read("inspections.txt").decode()
        assert json.loads(archive.read("alarms.json")) == {"active": [], "log": []}
    assert [line.split()[0] for line in inspections.splitlines()[1:4]] == [str(n) for n in reversed(numbers)]
