"""Promises of the security page: each has a test that is there."""

import ast
import re

REFERENCE = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?::(\w+)`")


def test_every_promise_has_a_test_that_is_there(root):
    text = (root / "docs" / "security.md").read_text()
    rows = [line for line in text.split("## Promises")[1].split("\n## ")[0].splitlines() if re.match(r"\| \d", line)]
    assert len(rows) > 20
    for row in rows:
        references = REFERENCE.findall(row)
        assert references, row
        assert len(references) == row.count("`tests/"), f"a whole file promises nothing: {row}"
        for file, group, name in references:
            tests = ast.parse((root / file).read_text()).body
            if group:
                [tests] = [each.body for each in tests if isinstance(each, ast.ClassDef) and each.name == group]
            assert name in {each.name for each in tests if isinstance(each, ast.FunctionDef)}, (file, group, name)
