"""Promises of the security page: each has a test that is there."""

import re

REFERENCE = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")


def test_every_promise_has_a_test_that_is_there(root):
    text = (root / "docs" / "security.md").read_text()
    rows = [line for line in text.split("## Promises")[1].split("\n## ")[0].splitlines() if re.match(r"\| \d", line)]
    assert len(rows) > 20
    for row in rows:
        references = REFERENCE.findall(row)
        assert references, row
        for file, name in references:
            assert re.search(rf"def {name}\b" if name else r"def test_", (root / file).read_text()), (file, name)
