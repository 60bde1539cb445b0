"""The configuration: defaults, then the file, then the environment, each as strict as the others."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.settings.configuration import Configuration, load_configuration
from station.settings.environment import named, overrides, variable, variables
from station.settings.model import Settings, setting
from station.settings.problems import Problem, SettingsError
from station.settings.schema import leaves, schema_of
from station.settings.validation import validated
from station.settings.yaml_loader import parse_document

EARLIER = "is a setting of an earlier version: `station config migrate FILE --write` brings the file up to date"


def problems(file: Path | None = None, **environ: str) -> list[str]:
    with pytest.raises(SettingsError) as caught:
        load_configuration(file, environ)
    return str(caught.value).splitlines()


def test_the_defaults_are_those_promised_and_on_loopback(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = load_configuration(environ={})
    assert (found.modbus.host, found.modbus.port, found.modbus.unit) == ("127.0.0.1", 5020, 1)
    assert (found.hmi.host, found.hmi.port) == ("127.0.0.1", 8080)
    assert (found.metrics.host, found.metrics.port) == ("127.0.0.1", 9108)
    assert (found.home, found.recipes_folder) == (tmp_path / "state", None)


class TestOrder:
    def test_the_environment_beats_the_file_and_the_file_the_defaults(self, write):
        file = write("modbus: {port: 502, unit: 9}\nhmi:\n  port: 81\n")
        found = load_configuration(file, {"STATION_MODBUS_PORT": "1502", "PATH": "x"})
        assert (found.modbus.port, found.modbus.unit, found.hmi.port, found.metrics.port) == (1502, 9, 81, 9108)

    def test_where_the_file_is_looked_for(self, write, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "state").mkdir()
        (tmp_path / "home").mkdir()
        first, second = write("hmi: {port: 1}", "a.yaml"), write("hmi: {port: 2}", "b.yaml")
        write("hmi: {port: 3}", "home/station.yaml")
        write("hmi: {port: 4}", "state/station.yaml")
        home = {"STATION_HOME": str(tmp_path / "home")}
        assert load_configuration(first, {"STATION_CONFIG": str(second), **home}).hmi.port == 1
        assert load_configuration(None, {"STATION_CONFIG": str(second), **home}).hmi.port == 2
        assert load_configuration(None, home).hmi.port == 3
        assert load_configuration(None, {}).hmi.port == 4

    def test_a_named_file_has_to_exist(self, tmp_path):
        missing = tmp_path / "none.yaml"
        assert problems(missing)[0].startswith(f"{missing}:1: file: expected a readable file")
        assert problems(STATION_CONFIG=str(missing))[0].startswith(f"{missing}:1: file: expected a readable file")
        assert problems(STATION_CONFIG="") == [
            "environment: STATION_CONFIG: expected the path of a file, written out without ~, got nothing"
        ]

    def test_paths_count_from_where_they_are_written(self, write, tmp_path, monkeypatch):
        (tmp_path / "etc").mkdir()
        (tmp_path / "cwd").mkdir()
        monkeypatch.chdir(tmp_path / "cwd")
        file = write("home: data\nrecipes_folder: ../ours\n", "etc/station.yaml")
        found = load_configuration(file, {})
        assert found.home == tmp_path / "etc" / "data"
        assert found.recipes_folder is not None
        assert found.recipes_folder.resolve() == tmp_path / "ours"
        assert load_configuration(file, {"STATION_HOME": "here"}).home == tmp_path / "cwd" / "here"
        assert load_configuration(write("hmi: {port: 1}", "etc/b.yaml"), {}).home == tmp_path / "cwd" / "state"

    @pytest.mark.parametrize("content", ["", "# nothing\n", "{}"])
    def test_an_empty_file_gives_the_defaults(self, write, content):
        assert load_configuration(write(content), {}) == load_configuration(None, {})


NO = 'expected a word that all YAML programs read alike, got no: write true or false, or "no" in quotes for a text'
PORT = "expected an integer from 1 to 65535, got"


class TestBadEnvironment:
    @pytest.mark.parametrize(
        ("name", "text", "expected"),
        [
            ("STATION_MODBUS_PORT", "x", f"{PORT} 'x'"),
            ("STATION_MODBUS_PORT", "", f"{PORT} nothing"),
            ("STATION_MODBUS_PORT", "0", f"{PORT} 0"),
            ("STATION_MODBUS_PORT", "502.0", f"{PORT} 502.0"),
            ("STATION_MODBUS_PORT", "012", f"{PORT} '012'"),
            ("STATION_MODBUS_PORT", "[", f"{PORT} '['"),
            ("STATION_MODBUS_PORT", "&a 1", f"{PORT} '&a 1'"),
            ("STATION_MODBUS_PORT", "true", f"{PORT} true"),
            ("STATION_MODBUS_PORT", "\udcff", f"{PORT} '\\udcff'"),
            ("STATION_MODBUS_UNIT", "248", "expected an integer from 1 to 247, got 248"),
            ("STATION_HMI_HOST", "127.0.0.300", "expected an IP address or a host's name, got '127.0.0.300'"),
            ("STATION_HMI_HOST", "\ud800", "expected a text of at most 253 characters, got '\\ud800'"),
            ("STATION_HMI_HOST", "a b", "expected an IP address or a host's name, got 'a b'"),
            ("STATION_HOME", "", "expected the path of a folder, written out without ~, got ''"),
            ("STATION_MODBUS_PROT", "1", "unknown variable: did you mean STATION_MODBUS_PORT?"),
            ("STATION_ZZZZZZZZZZZZ", "1", "unknown variable: see docs/configuration.md for those there are"),
            ("STATION_", "1", "unknown variable: see docs/configuration.md for those there are"),
        ],
    )
    def test_each_is_refused_by_its_name(self, name, text, expected):
        assert problems(**{name: text}) == [f"environment: {name}: {expected}"]

    def test_its_problems_and_the_files_come_together(self, write):
        file = write("hmi:\n  port: 99999\nmodbus: no\n")
        found = problems(file, STATION_METRICS_PORT="y", STATION_MODBUS_PORT="5", STATION_X="1")
        assert set(found) == {
            "environment: STATION_METRICS_PORT: expected an integer from 1 to 65535, got 'y'",
            "environment: STATION_X: unknown variable: see docs/configuration.md for those there are",
            f"{file}:2: hmi.port: expected an integer from 1 to 65535, got 99999",
            f"{file}:3: modbus: {NO}",
        }


class TestBadFile:
    @pytest.mark.parametrize(
        ("content", "expected"),
        [
            ("modbus:\n  prot: 1\n", "2: modbus.prot: unknown key prot: did you mean port?"),
            ("plc: {}\n", f"1: plc: unknown key plc: expected {', '.join(Configuration.model_fields)}"),
            *(
                (f"{section}:\n  {name}: 9\n", f"2: {section}.{name}: {name} {EARLIER}")
                for section, name in (("service", "channel"), ("arm", "restart_budget"), ("arm", "restart_window_s"))
            ),
            ("\nmetrics: 5020\n", "2: metrics: expected a mapping with host, port, got 5020"),
            ("home:\n", "1: home: expected a path, got nothing"),
            (
                "home: ~/station\n",
                "1: home: expected the path of a folder, written out without ~, got '~/station'",
            ),
            (
                f"home: /{'x' * 256}\n",
                f"1: home: expected a path of at most 1000 bytes, 255 a name, got '/{'x' * 38}…'",
            ),
            (
                f"home: {'/x' * 501}\n",
                f"1: home: expected a path of at most 1000 bytes, 255 a name, got '{'/x' * 19}/…'",
            ),
            ("recipes_folder: [a]\n", "1: recipes_folder: expected a path or null, got a list of 1 item"),
            ("hmi:\n  host: -x\n", "2: hmi.host: expected an IP address or a host's name, got '-x'"),
        ],
    )
    def test_each_is_refused_with_its_line(self, write, content, expected):
        file = write(content)
        assert problems(file) == [f"{file}:{expected}"]

    def test_the_environment_does_not_hide_what_is_wrong_around_it(self, write):
        for content, shown in (("metrics:\n", "nothing"), ("metrics: 7\n", "7")):
            file = write(content)
            expected = f"{file}:1: metrics: expected a mapping with host, port, got {shown}"
            assert problems(file, STATION_METRICS_PORT="502") == [expected]

    def test_two_servers_on_one_port(self, write):
        file = write("hmi:\n  port: 5020\n")
        assert problems(file) == [
            f"{file}:1: modbus.port: expected a port of its own, got 5020, which hmi.port is too",
            f"{file}:2: hmi.port: expected a port of its own, got 5020, which modbus.port is too",
        ]
        assert problems(STATION_HMI_PORT="9108")[0].startswith("environment: STATION_HMI_PORT: ")
        assert load_configuration(None, {"STATION_HMI_PORT": "9108", "STATION_HMI_HOST": "::1"}).hmi.host == "::1"


class Pose(Settings):
    """A section as a device might have one."""

    joints_rad: tuple[float, float] = setting((0.0, 1.0), title="Joints", description="Angles.", unit="rad")


class Site(Settings):
    """A configuration as it may become."""

    serial: str | None = setting(None, title="Serial", description="The sensor's serial number.")
    dry: bool = setting(False, title="Dry", description="Whether nothing moves.")
    pose: Pose = setting(Pose(), title="Pose", description="Where the arm waits.")


class TestEveryField:
    def test_has_a_variable_of_its_own(self):
        root = schema_of(Configuration)
        assert len(variables(root)) == len(list(leaves(root)))
        assert variable(("modbus", "port")) == "STATION_MODBUS_PORT"

    def test_texts_are_taken_as_they_stand_and_all_else_as_in_a_file(self):
        given = {"STATION_SERIAL": "012", "STATION_DRY": "true", "STATION_POSE_JOINTS_RAD": "[1, 2.5]"}
        assert overrides(schema_of(Site), given) == (
            {("dry",): True, ("pose", "joints_rad"): [1, 2.5], ("serial",): "012"},
            [],
        )

    def test_a_list_that_is_too_short_is_one_problem_with_the_variables_name(self):
        given, _ = overrides(schema_of(Site), {"STATION_POSE_JOINTS_RAD": "[1]"})
        document = parse_document(b"pose:\n  joints_rad:\n    - 1\n", "f")
        with pytest.raises(SettingsError) as caught:
            validated(Site, document, document.value, document.locate)
        expected = "expected a list of 2 items, each a number in rad, got a list of 1 item"
        assert str(caught.value) == f"f:2: pose.joints_rad: {expected}"
        assert named(("pose", "joints_rad", 1), given) == "STATION_POSE_JOINTS_RAD[1]"
        assert named(("pose", "joints_rad"), given) == "STATION_POSE_JOINTS_RAD"
        assert named(("pose",), given) is None

    def test_two_fields_with_one_variable_are_a_mistake_of_the_programmer(self):
        class Clash(Settings):
            """Two ways to one name."""

            pose: Pose = setting(Pose(), title="Pose", description="Where.")
            pose_joints_rad: int = setting(1, title="Joints", description="Number of them.")

        with pytest.raises(ValueError, match="STATION_POSE_JOINTS_RAD would set more than one thing"):
            variables(schema_of(Clash))


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(sorted(variables(schema_of(Configuration)))), st.text(st.characters(exclude_characters="\0")))
def test_whatever_a_variable_says_there_is_a_configuration_or_a_message(name, text):
    found: tuple[Problem, ...] | Configuration
    try:
        found = load_configuration(None, {name: text})
    except SettingsError as error:
        found = error.problems
    if isinstance(found, Configuration):
        assert found.home.is_absolute()
    else:
        assert {str(problem.place) for problem in found} <= {"environment", "built-in default"}
