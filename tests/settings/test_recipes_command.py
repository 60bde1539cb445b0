"""`station recipes check` as a user meets it."""

import os
import re
import subprocess

import pytest


@pytest.fixture
def station(station_here, tmp_path, monkeypatch):
    """Run the command line in an empty folder."""
    for name in [name for name in os.environ if name.startswith("STATION_")]:
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object, **environ: str) -> subprocess.CompletedProcess[str]:
        with monkeypatch.context() as given:
            for name, value in environ.items():
                given.setenv(name, value)
            return station_here(*arguments)

    return run


def test_the_shipped_recipes_are_good_from_anywhere(station):
    done = station("recipes", "check")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len(lines) == 4
    assert lines[3].startswith("OK ")
    assert lines[3].endswith(
        "strawberry.yaml: strawberry, PLC number 1, 22 to 53 mm wide, 12 steps of 1 mm, "
        "results at 1.9, 3, 4, 8, 12 mm, robust"
    )


def test_before_the_first_start_nobody_is_asked_to_submit_what_is_shipped(station):
    done = station("recipes", "list")
    assert (done.returncode, done.stderr) == (0, "")
    first, *others = done.stdout.splitlines()
    assert first.startswith("nothing is in force yet: the station's first start takes up what is here")
    assert [line.split(":")[0] for line in others] == ["blueberry", "raspberry", "rubber_ball", "strawberry"]


def test_all_problems_of_all_files_and_the_good_ones_beside_them(station, small, write):
    good = write(small, "good.yaml")
    bad = write(small.replace("force_n: 20", "force_n: 0").replace("step_mm: 1", "step_mm: x"), "bad.yaml")
    done = station("recipes", "check", good, bad, "none.yaml")
    assert done.returncode == 2
    assert done.stdout.startswith(f"OK {good}: cherry, PLC number 7")
    assert done.stderr.splitlines() == [
        f"{bad}:10: steps.step_mm: expected a number from 0.4 to 5 mm, got 'x'",
        f"{bad}:16: gripper.force_n: expected a number from 20 to 235 N, got 0",
        "none.yaml:1: file: expected a readable file: there is none with this name",
    ]


def test_the_configured_folder_is_checked(station, small, write, tmp_path):
    (tmp_path / "ours").mkdir()
    write(small, "ours/cherry.yaml")
    write("recipes_folder: ours\n", "station.yaml")
    for done in (
        station("recipes", "check", "--config", "station.yaml"),
        station("recipes", "check", STATION_CONFIG="station.yaml"),
        station("recipes", "check", STATION_HOME="."),
        station("recipes", "check", STATION_RECIPES_FOLDER="ours"),
        station("recipes", "check", "ours"),
    ):
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.count("OK ") == 1
        assert "cherry.yaml: cherry, PLC number 7" in done.stdout


def test_a_bad_environment_is_a_message_and_exit_code_2(station):
    done = station("recipes", "check", STATION_MODBUS_PROT="502")
    assert done.returncode == 2
    assert (
        done.stderr
        == "station: environment: STATION_MODBUS_PROT: unknown variable: did you mean STATION_MODBUS_PORT?\n"
    )


def test_what_is_hostile_is_a_message_and_exit_code_2(station, write, tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    bomb = "\n".join(["a0: &a0 [x]", *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40))])
    hostile = (
        tmp_path / "pipe.yaml",
        write(bomb, "bomb.yaml"),
        write(b"\xff\xfe", "bytes.yaml"),
        write("[" * 60_000, "deep.yaml"),
        write("", "empty.yaml"),
        "a\nb.yaml",
        "x" * 5000,
    )
    done = station("recipes", "check", *hostile)
    assert (done.returncode, done.stdout) == (2, "")
    lines = done.stderr.splitlines()
    assert all(re.match(r".+:\d+: .+: ", line) for line in lines)
    for path in hostile:
        shown = str(path).replace("\n", r"\n")[:900]
        assert [line for line in lines if line.startswith(shown)], shown


def test_the_guides_example_is_what_happens(station, root, write):
    shipped = (root / "recipes" / "strawberry.yaml").read_text()
    text = shipped.replace("step_mm: 1 ", "step_mm: fine ").replace("force_n: 20 ", "forse_n: 20 ")
    write(text, "my_cherry.yaml")
    command, *expected = re.findall(
        r"```\n\$ (station .*)\n((?:.*\n)+?)```", (root / "docs" / "recipes.md").read_text()
    )[0]
    assert station(*command.split()[1:]).stderr == "".join(expected)
