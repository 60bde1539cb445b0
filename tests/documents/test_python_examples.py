"""Python examples of the documents run as they are written."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NEEDS_A_STATION = ROOT / "docs" / "plc" / "quick-start.md"
"""Its example is run against a station by the PLC client's tests."""
EXAMPLES = [
    pytest.param(source, id=f"{page.stem}-{number}")
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if page != NEEDS_A_STATION
    for number, source in enumerate(
        re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    )
]


@pytest.mark.parametrize("source", EXAMPLES)
def test_an_example_runs(source: str) -> None:
    """It ends without an error, under the options that make warnings errors."""
    # Ten presses of six bodies take minutes; one of one shows whether the call is right.
    short = source.replace("seeds=range(10), kinds=KINDS", "seeds=range(1), kinds=KINDS[:1]")
    paths = os.pathsep.join((str(ROOT), str(ROOT / "benchmarks")))
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", short],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_there_are_examples() -> None:
    """The pages for researchers and on the twin have some."""
    assert len(EXAMPLES) >= 3
