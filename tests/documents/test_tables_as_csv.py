"""The tables of a document as CSV files: one for each table, with its cells."""

import csv
import re
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


def test_the_papers_page_states_in_words_only_what_its_tables_have():
    """Shares beside the tables are the requirement's, which the table of the causes fulfils."""
    text = (DOCS / "paper.md").read_text()
    reasons = text.split("### Reasons for the difference")[1].split("\n## ")[0]
    limits = [int(share) for share in re.findall(r"(\d+) %", reasons)]
    assert re.findall(r"\b\S+ %", reasons) == ["2 %", "5 %"]
    with (DOCS / "paper" / "causes.csv").open(newline="") as opened:
        rows = {row[""]: row for row in csv.DictReader(opened) if row["method"] == "robust"}
    for fruit, most in {"strawberry": limits[0], "blueberry": limits[0], "raspberry": limits[1]}.items():
        assert 100 * int(rows[fruit]["failed"]) <= most * int(rows[fruit]["samples"])
