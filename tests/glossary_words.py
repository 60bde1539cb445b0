"""Check of the glossary's words: finds words of its last column in names, docstrings' first lines and documents.

A docstring's first line that is a question clause is found too; of tests and benchmarks only that is.
`python -m tests.glossary_words` prints each place and exits with 1 if there is one; `./run check` calls it.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = "docs/glossary.md"
HISTORY = ("docs/decisions/", "CHANGELOG.md")
"""Documents of their time; decisions keep their words."""
OTHER_LANGUAGES = re.compile(r"\.(de|es)\.md$")
QUESTION = re.compile(r"(How|That|What|Where|Whether|Which|Who|Why)\b")
EVERYWHERE = ("",)

OTHER_SENSES: dict[str, tuple[str, tuple[str, ...]]] = {
    "bands": ("a loaded gel's at the image's border", ()),
    "body": ("a thing's, a request's", ()),
    "copy": ("a file's", ()),
    "drift": ("of light, of the reference", ()),
    "elements": ("achenes and drupelets as the method's details name them", ()),
    "form": ("of a page; a text's for one or for several", ()),
    "frame": ("an image; of a serial line", ("plc_interface/server",)),
    "gate": ("reject gate", ("station/vision", "station/calibration")),
    "lease": ("of the arm's health", ("plc_interface",)),
    "line": ("of production, of a text, of a drawing", ()),
    "margin": ("of a time", ("station/inspection",)),
    "message": ("an id with parameters; of CAN, MQTT, the channel", ("plc_interface/server",)),
    "order": ("of things in a row", ()),
    "pad": ("of the gripper", ("hmi",)),
    "settle": ("of fruit and gel after a move", ("plc_interface",)),
    "show": ("on a page or a terminal", ("plc_interface/handshake",)),
    "streaks": ("of the sensor's columns", ()),
    "trail": ("audit trail", ()),
    "truth": ("ground truth", ()),
    "undo": ("`deploy/install --undo`", ("hmi",)),
    "watch": ("to observe", ()),
    "words": ("of 16 bits; of a person or a library", ("hmi",)),
}
"""Words with another sense, which is meant; and the rooms in which it cannot be."""

MEANT: dict[str, tuple[str, ...]] = {
    # the PLC's command `call_off`
    "call off": ("station/commands/grip.py", "station/runtime/production/plc_commands.py"),
    "damaged passed": ("docs/grr.md",),  # column headings of a result
    "frame": ("plc_interface/server/exceptions.py", "plc_interface/server/mbap.py"),
    "gate": ("station/calibration/gate.py",),  # the recipe's `gate_ratio`
    "look": (
        "docs/alarms.md",  # a person does
    ),
    "shot": ("station/twin/can/gate.py",),  # `can.shot_deadline_s`
    "sound diverted": ("README.md", "docs/sorting.md", "docs/triggers.md"),  # column headings of a result
    "witness": ("docs/robust-constants.md",),
}
"""Files in which a word is meant literally, or is part of a published name."""


class Finding(NamedTuple):
    """A word to avoid, and where it is."""

    file: str
    line: int
    text: str
    word: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.word!r} in {self.text!r}"


def avoided(glossary: str) -> frozenset[str]:
    """Return the words of the last column.

    Args:
        glossary: its Markdown.
    """
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in glossary.splitlines() if line[:2] == "| "]
    cells = [row[3] for row in rows if len(row) == 4 and row[0] != "term"]
    return frozenset(word for cell in cells for word in cell.split(", ") if re.search(r"[a-z]", word))


def finder(words: Iterable[str]) -> Callable[[str], list[str]]:
    """Return a function that finds the words in a text, with a verb's or plural's regular ending."""
    patterns = {word: re.compile(rf"\b{re.escape(word)}(s|ed|ing)?\b") for word in words}
    return lambda text: [word for word, pattern in patterns.items() if pattern.search(text.lower())]


def of_module(file: str, source: str, find: Callable[[str], list[str]]) -> Iterator[Finding]:
    """Yield the findings in a module's name, in the names of its definitions, and in docstrings' first lines.

    A first line that is a question clause is one too.
    """
    yield from (Finding(file, 1, Path(file).stem, word) for word in find(spaced(Path(file).stem)))
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        line = 1 if isinstance(node, ast.Module) else node.lineno
        if not isinstance(node, ast.Module):
            yield from (Finding(file, line, node.name, word) for word in find(spaced(node.name)))
        first = (ast.get_docstring(node) or "").partition("\n")[0]
        if question := QUESTION.match(first):
            yield Finding(file, line, first, question[0])
        yield from (Finding(file, line, first, word) for word in find(without_code(first)))


def of_document(file: str, text: str, find: Callable[[str], list[str]]) -> Iterator[Finding]:
    """Yield the findings in a Markdown document, its code left out."""
    text = re.sub(r"^```.*?^```", lambda block: "\n" * block[0].count("\n"), text, flags=re.MULTILINE | re.DOTALL)
    for number, line in enumerate(text.splitlines(), 1):
        yield from (Finding(file, number, line.strip(), word) for word in find(without_code(line)))


def spaced(name: str) -> str:
    """Separate the words of a name."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", name).strip()


def without_code(text: str) -> str:
    """Leave out what is between backticks, and links' targets: published names, commands and files."""
    return re.sub(r"`[^`]*`|\]\([^)]*\)|<[^>]*>", " ", text)


def meant(finding: Finding) -> bool:
    """Check whether a word is used in another sense than the one to avoid."""
    _, rooms = OTHER_SENSES.get(finding.word, ("", EVERYWHERE))
    return not finding.file.startswith(rooms or ("/",)) or finding.file in MEANT.get(finding.word, ())


def findings() -> Iterator[Finding]:
    """Yield the words to avoid in the project."""
    find = finder(avoided((ROOT / GLOSSARY).read_text("utf-8")))
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "*.py", "*.md"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    for name in names:
        if not (ROOT / name).is_file() or name.startswith(HISTORY):
            continue
        text = (ROOT / name).read_text("utf-8")
        if name.startswith(("tests/", "benchmarks/")):
            found = of_module(name, text, finder(())) if name.endswith(".py") else ()
        elif name.endswith(".py"):
            found = of_module(name, text, find)
        elif name == GLOSSARY or OTHER_LANGUAGES.search(name):
            continue
        else:
            found = of_document(name, text, find)
        yield from (each for each in found if not meant(each))


if __name__ == "__main__":
    sys.exit("\n".join(map(str, findings())) or None)
