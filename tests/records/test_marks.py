"""Marks: a person's finding on a fruit, stored by a command with its author and time, and in the audit trail."""

from dataclasses import replace

import pytest

from station.messages import records as messages
from station.records.audit_report import read_audit
from station.records.database import reading


@pytest.fixture
def three_fruit(opened, scenario, trigger, passed):
    async def steps():
        async with opened() as records:
            for number in range(3):
                sequence = await records.begin(replace(trigger, lot=f"lot {number}"))
                await records.published(await records.conclude(sequence, passed))

    scenario(steps)


def test_fruit_are_marked_good_and_bad_and_the_trail_tells_what_changed(three_fruit, run_records, folder):
    assert run_records("mark", 1, 2, "good", "--by", "Ida").output == "2 of 2 fruit newly marked good\n"
    assert run_records("mark", 2, "bad", "--by", "Bo").output == "1 of 1 fruit newly marked bad\n"
    assert run_records("mark", 1, "good", "--by", "Bo").output == "0 of 1 fruit newly marked good\n"
    first, second = run_records("marks").output.splitlines()
    assert first.startswith("1  good  by Ida, 20")
    assert second.startswith("2  bad  by Bo, 20")
    assert run_records("mark", 1, "none", "--by", "Ida").exit_code == 0
    assert run_records("marks").output.splitlines() == [second]
    with reading(folder) as connection:
        rows = [(row.who, row.subject, row.old, row.new) for row in read_audit(connection, 9, "fruit.marked")]
    assert rows == [
        ("Ida", "inspection 1", None, '"good"'),
        ("Ida", "inspection 2", None, '"good"'),
        ("Bo", "inspection 2", '"good"', '"bad"'),
        ("Ida", "inspection 1", '"good"', None),
    ]


def test_where_one_of_several_fruit_is_not_there_none_is_marked(three_fruit, run_records):
    result = run_records("mark", 1, 99, "bad")
    assert result.exit_code == 1
    assert result.exception.cause == messages.NO_INSPECTION(number=99)
    assert run_records("marks").output == ""
    assert run_records("mark", 1, "ripe").exit_code == 2
