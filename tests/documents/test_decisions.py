"""Decision records: title and file name, status, date, sections, amendments marked in both records, and the index."""

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

SECTIONS = ["Context", "Decision", "Consequences"]
LINK = r"\[(\d+)\]\([^)]+\)"
STATUS = re.compile(rf"Status: (accepted|(?:amended|superseded) by {LINK}(?:, {LINK})*)\. Date: (\d{{4}}-\d\d-\d\d)\.")


@dataclass(frozen=True)
class Record:
    """A decision record; `head` is the paragraph below the title."""

    path: Path
    title: str
    head: str
    sections: list[str]

    @property
    def number(self) -> int:
        return int(self.path.name[:4])

    @property
    def status(self) -> str:
        found = STATUS.match(self.head)
        return found.group(1) if found else ""

    @property
    def date(self) -> str:
        found = STATUS.match(self.head)
        return found.groups()[-1] if found else ""

    def changed_by(self, verb: str) -> set[int]:
        """Numbers of the records that its status names as those that amended or superseded it."""
        return set(map(int, re.findall(LINK, self.status))) if self.status.startswith(verb) else set()

    def changes(self, verb: str) -> set[int]:
        """Numbers of the records that it amends or supersedes."""
        return set(map(int, re.findall(rf"{verb} {LINK}", self.head)))


def record(path, text):
    title, head = text.split("\n\n")[:2]
    return Record(path, title, head.replace("\n", " "), re.findall(r"^## (.+)$", text, re.MULTILINE))


def slug(title):
    return re.sub(r"[^a-z0-9]+", "-", title.lower().replace("'", "")).strip("-")


def faults(found):
    """Yield what is wrong with one record's file name, status and sections."""
    number, _, title = found.title.removeprefix("# ").partition(". ")
    if found.path.name != f"{int(number):04d}-{slug(title)}.md":
        yield "the file is not named by number and title"
    if not found.status:
        yield "no status and date"
    if found.sections != SECTIONS:
        yield f"sections {found.sections}"


@pytest.fixture(scope="module")
def records(root):
    paths = sorted((root / "docs" / "decisions").glob("[0-9]*.md"))
    return {found.number: found for found in (record(path, path.read_text("utf-8")) for path in paths)}


@pytest.fixture(scope="module")
def rows(root):
    """Cells of the index's rows by number."""
    lines = (root / "docs" / "decisions" / "index.md").read_text("utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if re.match(r"\| \d", line)]
    return {int(row[0]): row[1:] for row in cells}


def test_every_record_has_title_status_date_and_sections(records):
    assert [(found.path.name, fault) for found in records.values() for fault in faults(found)] == []
    assert len(records) >= 48


@pytest.mark.parametrize(
    ("name", "text", "fault"),
    [
        ("0007-a-dog.md", "# 7. A cat\n\nStatus: accepted. Date: 2026-11-21.\n\n", "not named"),
        ("0007-a-cat.md", "# 7. A cat\n\nStatus: accepted.\n\n", "no status and date"),
        ("0007-a-cat.md", "# 7. A cat\n\nStatus: amended. Date: 2026-11-21.\n\n", "no status and date"),
    ],
)
def test_a_record_that_differs_is_found(name, text, fault):
    sections = "".join(f"## {section}\n\n" for section in SECTIONS)
    assert [fault in each for each in faults(record(Path(name), text + sections))] == [True]
    assert "sections []" in list(faults(record(Path(name), text)))


@pytest.mark.parametrize(("new", "old"), [("Amends", "amended"), ("Supersedes", "superseded")])
def test_both_records_name_each_other(records, new, old):
    forward = {(found.number, each) for found in records.values() for each in found.changes(new)}
    backward = {(each, found.number) for found in records.values() for each in found.changed_by(old)}
    assert forward == backward
    assert forward


def test_the_index_has_every_number_with_subject_status_and_date(records, rows):
    assert list(rows) == list(range(1, max(records) + 1))
    for number, found in records.items():
        subject = found.title.partition(". ")[2]
        assert rows[number] == [f"[{subject}]({found.path.name})", found.status, found.date]


def test_the_index_explains_each_missing_number(records, rows):
    for number in set(rows) - set(records):
        subject, status, _ = rows[number]
        assert "robust-method-history.md" in subject or status == "number never used"
