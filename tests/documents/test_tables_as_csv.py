"""The tables of a document as CSV files: one for each table, with its cells."""

import csv
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_each_csv_file_has_the_cells_of_its_table():
    text = (DOCS / "paper.md").read_text()
    files = sorted((DOCS / "paper").glob("*.csv"))
    assert len(files) >= 6
    for file in files:
        table = text.split(f"<!-- {file.stem} -->\n")[1].split(f"<!-- /{file.stem} -->")[0].replace("`", "")
        lines = [line for line in table.splitlines() if line.startswith("|") and not line.startswith("|---")]
        with file.open(newline="") as opened:
            rows = list(csv.reader(opened))
        assert [[cell.strip() for cell in line.strip("|").split("|")] for line in lines] == rows, file.name
