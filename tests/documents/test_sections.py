"""Generated sections of documents: written between their marks, whole or by rows."""

import pytest

from benchmarks.sections import with_rows, write

HEAD = ["| used | fruit | share |", "|---|---|---|"]
PAGE = "before\n<!-- worth -->\n{}\n<!-- /worth -->\nafter\n"


@pytest.fixture
def page(tmp_path):
    place = tmp_path / "page.md"
    place.write_text(PAGE.format("\n".join([*HEAD, "| all | a | 1 |", "| all | b | 2 |", "| less | a | 3 |"])))
    return place


def test_rows_that_were_made_again_take_the_place_of_theirs_and_the_others_stay(page):
    rows = with_rows(page, "worth", [*HEAD, "| less | a | 30 |", "| all | a | 10 |"], keys=2)
    assert rows == [*HEAD, "| all | a | 10 |", "| all | b | 2 |", "| less | a | 30 |"]
    write(page, {"worth": rows})
    assert page.read_text() == PAGE.format("\n".join(rows))


def test_a_row_that_was_not_there_comes_last(page):
    assert with_rows(page, "worth", [*HEAD, "| less | b | 4 |"], keys=2)[-1] == "| less | b | 4 |"


def test_a_table_with_other_columns_is_not_mixed(page):
    with pytest.raises(SystemExit, match="make all of its rows"):
        with_rows(page, "worth", ["| used | fruit |", "|---|---|", "| all | a |"], keys=2)
    with pytest.raises(SystemExit, match="one section other"):
        with_rows(page, "other", HEAD, keys=2)
