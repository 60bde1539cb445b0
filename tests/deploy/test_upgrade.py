"""Upgrades of a running station: refused, taken back by itself, done, and taken back by a person."""

import json
import shutil
import sqlite3
import subprocess
import urllib.request
from contextlib import closing

import pytest

pytestmark = pytest.mark.timeout(900)  # four starts of a whole station, on a busy machine


@pytest.fixture
def installation(installer, sources, environment):
    """One run of the installer: of a version, in a scratch root, with its services."""

    def make(layout, services, version):
        what = installer("release").Source(sources[version])
        packages = installer("release").Packages(environment=environment)
        return installer("installation").Installation(layout, services, what, packages, limit_s=200.0)

    return make


def form_of(layout):
    with closing(sqlite3.connect(layout.home / "records/records.sqlite3")) as connection:
        return connection.execute("SELECT version_num FROM alembic_version").fetchone()[0]


def test_a_running_station_is_upgraded_or_left_as_it_was(
    stand_in, installer, installation, install, unused_ports, sources, monkeypatch
):
    monkeypatch.setenv("PYTHONPATH", str(sources["0.1.0"]))  # a person's own is no matter to a release's programs
    refused, failed = installer("messages").Refused, installer("messages").Failed
    layout, settings = stand_in.layout, stand_in.layout.configuration
    modbus, hmi, metrics = unused_ports(3)
    settings.parent.mkdir(parents=True)
    settings.write_text(
        f"# the packhouse's\nmodbus: {{port: {modbus}}}\nhmi:\n  port: {hmi}\n  idle_s: 60.0  # a minute\n"
        f"metrics: {{port: {metrics}}}\narm: {{host: 127.0.0.1}}\n"
    )
    ours = settings.read_text()

    def version():
        with urllib.request.urlopen(f"http://127.0.0.1:{metrics}/version", timeout=20) as answer:
            return json.load(answer)["fruit-station"]

    installation(layout, stand_in, "0.1.0").run()
    assert version() == "0.1.0"
    stand_in.heard.clear()
    stand_in.hear("WATCHDOG=1")
    form = form_of(layout)
    process = stand_in.process

    # A bad configuration: refused, and the old one runs on.
    settings.write_text(ours.replace(str(hmi), "99999"))
    with pytest.raises(refused, match=r"station\.yaml:4: hmi\.port: expected an integer from 1 to 65535"):
        installation(layout, stand_in, "0.2.0").run()
    settings.write_text(ours)
    assert (stand_in.process, stand_in.running(), version()) == (process, True, "0.1.0")

    # A lot under way: refused, unless a person forces it.
    def station(*words):
        program = layout.current / "venv/bin/station"
        subprocess.run([program, *words], env=layout.environment(), check=True, capture_output=True)

    station("records", "lot", "start", "A-17", "--grower", "Meier")
    with pytest.raises(refused, match="the lot A-17 is under way"):
        installation(layout, stand_in, "0.2.0").check(during_lot=False)
    installation(layout, stand_in, "0.2.0").check(during_lot=True)
    station("records", "lot", "end", "A-17")
    installation(layout, stand_in, "0.2.0").check(during_lot=False)

    # A new version that does not become ready: the old one is back, with its configuration and its records.
    (layout.home / "no-pages").touch()
    with pytest.raises(failed, match=r"0\.2\.0\+.* is not in use: 0\.1\.0\+.* is again"):
        installation(layout, stand_in, "0.2.0").run()
    (layout.home / "no-pages").unlink()
    assert version() == "0.1.0"
    assert settings.read_text() == ours
    assert form_of(layout) == form
    assert not layout.upgrade.exists()

    # The same with its cause mended, and a new disk at /var/backups.
    shutil.rmtree(layout.backups)
    installation(layout, stand_in, "0.2.0").run()
    assert version() == "0.2.0"
    assert "logged_out_after_s: 60.0" in settings.read_text()
    assert settings.read_text().startswith("# the packhouse's")
    assert form_of(layout) == "9999"
    copy = layout.backups / json.loads(layout.upgrade.read_text())["copy"]
    assert (copy / "settings/station.yaml").read_text() == ours
    assert (copy / "records/backup.json").exists()
    stand_in.stop()
    assert "STOPPING=1" in stand_in.heard

    # Taken back by a person.
    done = install("--root", layout.root, "--rollback")
    assert done.returncode == 0, done.stdout
    assert layout.current.resolve().name.startswith("0.1.0+")
    assert settings.read_text() == ours
    assert form_of(layout) == form
    assert list((layout.home / "records/aside").iterdir())
    assert install("--root", layout.root, "--rollback").returncode == 2


def test_ended_between_any_two_steps_the_next_run_comes_to_the_same_end(
    tmp_path, installer, installation, releases, tree_of, monkeypatch
):
    # Both run programs, which takes long; the test above runs them.
    def changes(layout, _release):
        return ("old is new now",) if "# old" in layout.configuration.read_text() else ()

    def migrate(layout, _release):
        layout.configuration.write_text(layout.configuration.read_text().replace("# old", "# new"))

    monkeypatch.setattr(installer("configuration"), "try_with", changes)
    monkeypatch.setattr(installer("configuration"), "migrate", migrate)
    layouts, services = installer("layout"), installer("services").ScratchRoot
    shutil.copytree(releases, tmp_path / "old", symlinks=True)

    def started(folder, version):
        layout = layouts.Layout(folder)
        return installation(layout, services(layout), version)

    first = started(tmp_path / "old", "0.1.0")
    for step in first.steps()[:-1]:  # the last removes the releases that are made for what follows
        step.do()
    first_layout = layouts.Layout(tmp_path / "old")
    first_layout.configuration.write_text("# old\n")
    count = len(started(tmp_path / "old", "0.2.0").steps())
    assert count > 8
    wanted = None
    for done in (0, *range(1, count)):
        folder = tmp_path / f"after-{done}"
        shutil.copytree(tmp_path / "old", folder, symlinks=True)
        for step in started(folder, "0.2.0").steps()[:done]:
            step.do()
        started(folder, "0.2.0").run()
        layout = layouts.Layout(folder)
        assert layouts.target(layout.current).name.startswith("0.2.0+")
        assert layouts.target(layout.previous).name.startswith("0.1.0+")
        tree = {name: what for name, what in tree_of(folder).items() if not name.startswith(("opt/", "var/backups/"))}
        wanted = wanted or tree
        assert tree == wanted, f"after {done} steps"
        assert layout.configuration.read_text() == "# new\n"
        installer("rollback").roll_back(layout, services(layout))
        assert layout.configuration.read_text() == "# old\n", f"after {done} steps, and back"
        assert layouts.target(layout.current).name.startswith("0.1.0+")
