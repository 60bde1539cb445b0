"""`station administrator`: the first person of a station without a screen, who can log in at once."""

import pytest
from click.testing import CliRunner

from hmi.web.roles import Role
from hmi.web.user_store import FILE_NAME, FOLDER, UserStore
from station.cli import cli

PIN = "738291"


@pytest.fixture
def station(tmp_path):
    """Run the command for Ada, with what is typed."""
    runner = CliRunner(env={"STATION_HOME": str(tmp_path)})

    def run(*arguments, typed=f"{PIN}\n{PIN}\n"):
        return runner.invoke(cli, arguments, input=typed)

    return run


def test_the_first_person_logs_in_at_pages_that_run_already_and_is_in_the_trail(station, tmp_path):
    pages = UserStore(tmp_path / FOLDER)
    assert pages.first_start
    done = station("administrator", "Ada", "--by", "Max")
    assert done.exit_code == 0, done.output
    assert PIN not in done.output
    assert not pages.first_start
    assert pages.check("Ada", PIN) is Role.ADMIN
    output = station("audit", "show", "--action", "panel.").output
    assert "panel.added  Ada  by Max (command line)" in output
    assert "new: role admin" in output


def test_nobody_becomes_an_administrator_beside_another(station, tmp_path):
    UserStore(tmp_path / FOLDER).begin("Ida", "915373")
    refused = station("administrator", "Ada")
    assert isinstance(refused.exception, Exception)
    assert "already chosen" in str(refused.exception)
    assert UserStore(tmp_path / FOLDER).names() == {"Ida": Role.ADMIN}
    assert "Ada" not in station("audit", "show").output


@pytest.mark.parametrize(("name", "pin", "message"), [("Ada", "111111", "too easy"), (" Ada", PIN, "characters")])
def test_a_bad_pin_or_name_leaves_the_first_start(station, tmp_path, name, pin, message):
    refused = station("administrator", name, typed=f"{pin}\n{pin}\n")
    assert message in str(refused.exception)
    assert UserStore(tmp_path / FOLDER).first_start
    assert "panel.added" not in station("audit", "show").output


def test_a_broken_file_is_no_first_start(station, tmp_path):
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / FILE_NAME).write_text("{")
    assert "cannot be read" in str(station("administrator", "Ada").exception)
    assert (tmp_path / FOLDER / FILE_NAME).read_text() == "{"
