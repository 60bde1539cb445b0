"""CSV tables."""

import csv
from pathlib import Path


def read_table(path: Path) -> list[dict[str, str]]:
    """Read a table's rows by its header."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
