"""Searches by one touch: what each link searches for, beside the conditions that are there."""

from datetime import datetime
from urllib.parse import parse_qs, urlencode, urlsplit

import pytest

from hmi.history.chips import chips, days, unseen
from hmi.past.past import Page

NAMES: list[str] = ["lot", "grower", "fruit", "outcome", "reason", "from", "to"]
NO_TERMS = dict.fromkeys(NAMES, "")
NOW = datetime(2026, 3, 1, 14, 30).astimezone()


def query(address):
    return {key: values[0] for key, values in parse_qs(urlsplit(address).query).items()}


def test_a_chip_adds_its_condition_and_takes_it_back():
    by_fruit = {**NO_TERMS, "fruit": "raspberry"}
    fail = next(each for each in chips(by_fruit, "A & B", NOW) if each.name == "fail")
    assert (fail.on, query(fail.address)) == (False, {"fruit": "raspberry", "outcome": "FAIL"})
    again = next(each for each in chips({**by_fruit, "outcome": "FAIL"}, "A & B", NOW) if each.name == "fail")
    assert (again.on, query(again.address)) == (True, {"fruit": "raspberry"})


def test_the_current_lot_is_a_chip_only_where_there_is_one():
    lot = next(each for each in chips(NO_TERMS, "A & B", NOW) if each.name == "lot")
    assert query(lot.address) == {"lot": "A & B"}
    assert "lot" not in {each.name for each in chips(NO_TERMS, None, NOW)}


def test_days_go_over_the_months_end_and_start_at_the_searchs_day():
    assert query(days(NO_TERMS, NOW).before) == {"from": "2026-02-28T00:00", "to": "2026-03-01T00:00"}
    shown = {**NO_TERMS, "from": "2025-12-31T10:00"}
    assert query(days(shown, NOW).after) == {"from": "2026-01-01T00:00", "to": "2026-01-02T00:00"}
    assert query(days({**NO_TERMS, "from": "nonsense"}, NOW).after)["from"] == "2026-03-02T00:00"


@pytest.mark.parametrize("day", ["0001-01-01T00:00", "9999-12-30T00:00", "9999-12-31T00:00", "0001-01-02T00:00+14:00"])
def test_an_end_of_the_calendar_has_no_day_beside_it(pages, day):
    assert days({**NO_TERMS, "from": day}, NOW) == days(NO_TERMS, NOW)
    with pages.context.past:
        assert pages("GET", f"/history?{urlencode({'from': day})}")[0] < 500


DAY = {"from": "2026-02-28T00:00", "to": "2026-03-01T00:00"}


@pytest.mark.parametrize(
    ("terms", "is_unseen", "dated"),
    [
        ({}, False, False),
        ({"outcome": "FAIL", **DAY}, False, True),
        ({"lot": "A-17"}, True, False),
        ({"grower": "West"}, True, False),
        ({"fruit": "raspberry", **DAY}, True, True),
        ({"reason": "late"}, True, False),
        ({"outcome": "PASS"}, True, False),
        ({"from": "2026-02-28T00:00"}, True, False),
        ({**DAY, "to": "2026-03-02T00:00"}, True, False),
    ],
)
def test_every_condition_is_seen_and_a_date_only_where_it_is_searched(pages, monkeypatch, terms, is_unseen, dated):
    async def found(*_):
        return Page((), None)

    monkeypatch.setattr(pages.context.past, "find", found)
    with pages.context.past:
        status, _, body = pages("GET", f"/history?{urlencode(terms)}")
    assert status == 200
    text = body.decode()
    assert ('<details class="card" open>' in text) == is_unseen
    label = text.partition('<span class="days">')[2].partition("</span>")[0]
    assert ("<b>2026-02-28</b>" in label, "<b>" in label) == (dated, dated)


def test_the_current_lot_is_seen_in_its_chip():
    terms = {**NO_TERMS, "lot": "A-17"}
    assert not unseen(terms, "A-17", days(terms, NOW))
    assert unseen(terms, "B-18", days(terms, NOW))
