"""Generated sections of documents, each between its marks."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path


def with_rows(document: Path, name: str, lines: Sequence[str], keys: int) -> list[str]:
    """Return a document's table with some of its rows made again.

    Args:
        document: as `write` has it.
        name: of the section.
        lines: a table with the same columns; its rows take the place of those with the same first cells.
        keys: how many cells identify the row.

    Raises:
        SystemExit: the document does not have the section exactly once, or its columns are others.
    """
    found = re.findall(rf"<!-- {name} -->\n(.*?)<!-- /{name} -->", document.read_text(encoding="utf-8"), re.DOTALL)
    if len(found) != 1 or found[0].splitlines()[:2] != lines[:2]:
        raise SystemExit(f"{document}: expected one section {name} with the columns {lines[0]}: make all of its rows")
    made = {tuple(line.split("|")[1 : 1 + keys]): line for line in lines}
    rows = [made.pop(tuple(line.split("|")[1 : 1 + keys]), line) for line in found[0].splitlines()]
    return [*rows, *made.values()]


def write(document: Path, sections: Mapping[str, Sequence[str]]) -> None:
    """Put tables between their marks in a document.

    Args:
        document: Markdown with `<!-- name -->` and `<!-- /name -->` around each section.
        sections: lines by the section's name.

    Raises:
        SystemExit: the document does not have a section's marks exactly once.
    """
    text = document.read_text(encoding="utf-8")
    for name, lines in sections.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)"
        table = "\n".join(lines) + "\n"
        text, times = re.subn(pattern, lambda marks, table=table: marks[1] + table + marks[2], text, flags=re.DOTALL)
        if times != 1:
            raise SystemExit(f"{document}: expected the marks <!-- {name} --> and <!-- /{name} --> once")
    document.write_text(text, encoding="utf-8")
