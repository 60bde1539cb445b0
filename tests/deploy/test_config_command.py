"""`station config`: an earlier program's file brought up to date, checked and shown."""

import json

import pytest
from click.testing import CliRunner

from station.cli import cli
from station.settings import migration
from station.settings.configuration import Configuration
from station.settings.problems import SettingsError
from station.settings.schema import leaves, schema_of

EARLIER = "# the packhouse's\nservice:\n  channel: ipc:///run/short  # short\nhmi:\n  port: 8443  # mine\n"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "station.yaml"
    path.write_text(EARLIER)
    path.chmod(0o640)
    return path


def config(*arguments):
    return CliRunner().invoke(cli, ["config", *map(str, arguments)])


def test_an_earlier_file_is_brought_up_to_date_once_and_keeps_its_comments(file):
    assert isinstance(config("check", "--config", file).exception, SettingsError)
    result = config("migrate", file)
    assert result.output == f"{file}: service.channel is handshake.endpoint now\n"
    assert file.read_text() == EARLIER, "without --write"
    assert config("migrate", "--write", file).exit_code == 0
    assert "# the packhouse's" in file.read_text()
    assert "port: 8443  # mine" in file.read_text()
    assert file.stat().st_mode & 0o777 == 0o640
    assert config("check", "--config", file).output.startswith("OK: home ")
    after = file.read_text()
    assert config("migrate", "--write", file).output == f"{file}: nothing to change\n"
    assert file.read_text() == after
    shown = json.loads(config("show", "--config", file).output)
    assert (shown["handshake"]["endpoint"], shown["hmi"]["port"]) == ("ipc:///run/short", 8443)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("arm:\n  restart_budget: 9\n  host: 10.0.0.2  # the cell's\n", "arm:\n  host: 10.0.0.2  # the cell's\n"),
        ("hmi:\n  port: 8443\narm:\n  restart_budget: 9\n  restart_window_s: 30\n", "hmi:\n  port: 8443\n"),
    ],
)
def test_a_setting_that_is_gone_is_removed(file, before, after):
    file.write_text(before)
    assert isinstance(config("check", "--config", file).exception, SettingsError)
    output = config("migrate", "--write", file).output
    assert output.startswith(f"{file}: arm.restart_budget is gone, as it has no effect any more\n")
    assert file.read_text() == after
    assert config("check", "--config", file).exit_code == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "service: {channel: 'ipc:///a'}\nhandshake: {endpoint: 'ipc:///b'}\n",
            "is handshake.endpoint now, which is there too",
        ),
        ("service: [", "expected valid YAML"),
        ("- 1\n", "expected settings by their names"),
        ("a: b\n" * 20_000, "expected at most 64 KiB"),
        (b"\xff\xfe", "expected UTF-8 text"),
    ],
)
def test_what_cannot_be_migrated_is_said_and_left(file, text, words):
    content = text if isinstance(text, bytes) else text.encode()
    file.write_bytes(content)
    error = config("migrate", "--write", file).exception
    assert isinstance(error, SettingsError)
    assert words in str(error)
    assert file.read_bytes() == content


def test_a_file_that_is_not_there_is_said(tmp_path):
    assert "expected a readable file" in str(config("migrate", tmp_path / "none.yaml").exception)


def test_what_is_all_comments_stays(file, root):
    assert migration.migrated((root / "deploy/station.yaml").read_bytes(), "station.yaml") == ("", ())


def test_every_move_leads_to_a_setting_of_this_program_and_from_none():
    fields = {leaf.path for leaf in leaves(schema_of(Configuration))}
    for move in migration.MOVES:
        assert move.new in fields
        assert move.old not in fields
    assert not fields.intersection(migration.WITHOUT_EFFECT)
