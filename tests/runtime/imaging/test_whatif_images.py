"""Images that a station has really stored: the what-if measures them again for a draft with another segmentation."""

import asyncio
import json

import pytest
from click.testing import CliRunner

from station.cli import cli
from station.records.database import reading, records_folder
from station.settings.recipe import find_recipe


@pytest.fixture
def inspected(bench, settings_file):
    """The configuration's file of a station that has inspected a fruit, passed it and stored its images."""
    file = settings_file()
    values = json.loads(file.read_text())
    values["records"]["accepted_share"] = 1.0
    file.write_text(json.dumps(values))

    async def scenario():
        async with bench(file) as cell:
            await cell.choose("blueberry")
            outcome = await cell.line.inspect()
            assert outcome.outcome == "PASS", outcome
            async with asyncio.timeout(60):
                while cell.station.service.registry.records.status().images_waiting:
                    await asyncio.sleep(0.05)

    asyncio.run(scenario())
    return file


def test_a_draft_with_another_segmentation_measures_the_stored_images_again(inspected, tmp_path):
    home = tmp_path / "home"
    with reading(records_folder(home)) as connection:
        stored = connection.exec_driver_sql("SELECT area_mm2 FROM curve_points WHERE sequence = 1 ORDER BY step")
        stored_mm2 = [area_mm2 for (area_mm2,) in stored]

    def whatif(name, **changes):
        values = find_recipe("blueberry", tmp_path / "recipes").model_dump(mode="json")
        values["segmentation"]["robust"] |= changes
        values["damage"]["area"][0] |= {"area_mm2": 10.0, "least_area_mm2": 1.0}  # so that the fruit changes sides
        draft, out = tmp_path / f"{name}.yaml", tmp_path / name
        draft.write_text(json.dumps(values))
        arguments = ["whatif", "--recipe", str(draft), "--out", str(out), "--jobs", "1", "--config", str(inspected)]
        done = CliRunner().invoke(cli, arguments)
        assert done.exit_code == 0, (done.output, done.exception)
        return done.output, out

    output, out = whatif("other", edge_stiffness=1.5)
    assert "1 inspections, 1 decided by the draft" in output
    assert "1 measured again in their stored images" in output
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["measured_again"], summary["not_reproduced"], summary["newly_rejected"]) == (1, 0, 1)
    _, line = (out / "replayed.jsonl").read_text().splitlines()
    again_mm2 = json.loads(line)["areas_mm2"]
    assert len(again_mm2) == len(stored_mm2)
    assert again_mm2 != pytest.approx(stored_mm2)
    assert again_mm2[-1] == pytest.approx(stored_mm2[-1], rel=0.5), "the same contact by another edge"
    page = (out / "whatif.html").read_text()
    assert "data:image/jpeg;base64," in page
    assert page.count('<polyline class="curve ') == 2, "the curve of then, and the draft's"

    output, out = whatif("same")
    assert "measured again" not in output
    assert json.loads((out / "summary.json").read_text())["measured_again"] == 0

    output, out = whatif("less_confidence", least_confidence=0.0)
    assert "1 measured again in their stored images" in output, (
        "a contact is drawn otherwise where confidence is lacking"
    )

    with reading(records_folder(home)) as connection:
        found = connection.exec_driver_sql("SELECT sha256 FROM images WHERE kind = 'step' AND step = 1").scalar()
    (path,) = (records_folder(home) / "images").glob(f"*/{found}.png")
    path.unlink()
    output, out = whatif("without_one", edge_stiffness=1.5)
    assert "cannot be known: 1: the draft measures otherwise, and not all of its images were kept" in output
