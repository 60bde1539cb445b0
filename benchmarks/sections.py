"""Generated sections of documents, each between its marks."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path


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
