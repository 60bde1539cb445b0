"""The loader refuses what is doubtful, with the line, and reads the rest as YAML 1.2 does."""

import contextlib
import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from station.settings.commented_text import CommentedText
from station.settings.problems import SettingsError
from station.settings.yaml_loader import parse_document, read_document

ROOT = Path(__file__).resolve().parents[2]
ALIKE = "expected a word that all YAML programs read alike, got"
NUMBER = "write a number of at most 18 decimal digits without exponent and leading zeros, or"
SWITCH = "write true or false, or"
PLAIN = "write it out without anchors, aliases and tags"


def alike(word, hint="write", place="f:1: a"):
    """Return the expected problems for a word with more than one meaning."""
    return [f'{place}: {ALIKE} {word}: {hint} "{word}" in quotes for a text']


BAD = {
    "doubled key": ("a: 1\nb: 2\na: 3\n", ["f:3: a: expected once, got it again: it is on line 1 already"]),
    "doubled in a list": (
        "l:\n  - x: 1\n    x: 2\n",
        ["f:3: l[0].x: expected once, got it again: it is on line 2 already"],
    ),
    "NO": ("a: NO", alike("NO", SWITCH)),
    "yes": ("a: yes", alike("yes", SWITCH)),
    "octal": ("a: 012", alike("012", NUMBER)),
    "no octal": ("a: 09", alike("09", NUMBER)),
    "octal 1.2": ("a: 0o17", alike("0o17", NUMBER)),
    "binary": ("a: 0b11", alike("0b11", NUMBER)),
    "exponent": ("a: 1e3", alike("1e3", NUMBER)),
    "huge exponent": ("a: 1e999", alike("1e999", NUMBER)),
    "sexagesimal": ("a: 1:30", alike("1:30", NUMBER)),
    "underscore": ("a: 1_000", alike("1_000", NUMBER)),
    "date": ("a: 2025-01-31", alike("2025-01-31")),
    "date and time": ("a: 2025-01-31T12:30:00Z", alike("2025-01-31T12:30:00Z")),
    "equals sign": ("a: =", alike("=")),
    "NaN": ("a: .nan", alike(".nan", NUMBER)),
    "infinity": ("a:\n  - -.Inf", alike("-.Inf", NUMBER, "f:2: a[0]")),
    "overflow": ("a: 1.0e+999", alike("1.0e+999", NUMBER)),
    "many digits": ("a: " + "9" * 5000, alike("9" * 39 + "…", NUMBER)),
    "huge integer": ("a: 1000000000000000001", alike("1000000000000000001", NUMBER)),
    "key on": ("on: 1", alike("on", SWITCH, "f:1: on")),
    "key number": ("1: x", ["f:1: 1: expected a key that is a text, got 1"]),
    "key nothing": ("? \n: x", ["f:1: ?: expected a key that is a text, got nothing"]),
    "key list": ("? [a]\n: x", ["f:1: file: expected a key that is a text, got a list of 1 item"]),
    "key mapping": ("? {a: b}\n: x", ["f:1: file: expected a key that is a text, got a mapping"]),
    "anchor": ("a: &x 1\nb: 2\n", [f"f:1: file: expected a plain value, got &x: {PLAIN}"]),
    "alias": ("a: 1\nb: *x\n", [f"f:2: file: expected a plain value, got *x: {PLAIN}"]),
    "merge": ("a: {}\nb:\n  <<: {c: 1}\n", alike("<<", place="f:3: b.<<")),
    "python tag": (
        "a: !!python/object/apply:os.system [ls]\n",
        [f"f:1: file: expected a plain value, got tag:yaml.org,2002:python/object/apply:os.system: {PLAIN}"],
    ),
    "own tag": ("a: !x 1", [f"f:1: file: expected a plain value, got !x: {PLAIN}"]),
    "two documents": (
        "a: 1\n---\na: 2\n",
        ["f:2: file: expected valid YAML: expected a single document in the stream but found another document"],
    ),
    "tab": ("a:\n\tb: 1\n", ["f:2: file: expected spaces, got a tab"]),
    "broken": (
        "a: [1, 2\nb: 3\n",
        ["f:2: file: expected valid YAML: while parsing a flow sequence expected ',' or ']', but got ':'"],
    ),
    "several": (
        "a: NO\nb: 1\nb: 2\n",
        [*alike("NO", SWITCH), "f:3: b: expected once, got it again: it is on line 2 already"],
    ),
    "not UTF-8": (b"a: 1\nb: \xff\n", ["f:2: file: expected UTF-8 text, got the byte 0xff"]),
    "UTF-16": ("a: 1".encode("utf-16"), ["f:1: file: expected UTF-8 text, got the byte 0xff"]),
    "control character": (b"a: 1\nb: \x07\n", ["f:2: file: expected printable text, got a control character"]),
    "beyond Unicode": ('a:\n  b: "\\UFFFFFFFF"\n', ["f:2: file: expected characters that exist in Unicode"]),
    "half a character": ('a: "\\ud800"', ["f:1: a: expected characters that exist in Unicode"]),
    "deep": ("a: " + "[" * 30_000, ["f:1: file: expected at most 12 levels of nesting"]),
    "many": ("[" + "1," * 12_000 + "]", ["f:1: file: expected at most 10000 keys and values"]),
}


@pytest.mark.parametrize(("content", "expected"), BAD.values(), ids=BAD)
def test_what_is_doubtful_is_refused_with_its_place(content, expected):
    content = content if isinstance(content, bytes) else content.encode()
    found = [str(problem) for problem in parse_document(content, "f").problems]
    assert found == expected


def test_plain_words_are_read_as_both_versions_of_yaml_do():
    text = (
        "a: 12\nb: -0.5\nc: 0x1F\nd: true\ne: False\nf: .5\ng: 1.\nh: 1.5e+3\ni: null\nj: x y\nk: 1.0.0.1\nl: [1, a]\n"
    )
    assert parse_document(text.encode(), "f").value == {
        "a": 12, "b": -0.5, "c": 31, "d": True, "e": False, "f": 0.5, "g": 1.0, "h": 1500.0, "i": None, "j": "x y",
        "k": "1.0.0.1", "l": [1, "a"],
    }  # fmt: skip


def test_every_value_knows_its_line_also_with_windows_line_ends_and_a_byte_order_mark():
    document = parse_document(b"\xef\xbb\xbfa: 1\r\n\r\nb:\r\n  - x\r\n  - y: 2\r\n", "f")
    assert document.value == {"a": 1, "b": ["x", {"y": 2}]}
    assert document.lines == {(): 1, ("a",): 1, ("b",): 3, ("b", 0): 4, ("b", 1): 5, ("b", 1, "y"): 5}
    assert [str(part) for part in document.locate(("b", 1, "z"))] == ["f:5", "b[1].z"]


@pytest.mark.parametrize("content", [b"", b"# only a comment\n", b"---\n", b"\n\n"])
def test_nothing_at_all_is_none(content):
    assert parse_document(content, "f").value is None
    assert not parse_document(content, "f").problems


def test_an_anchor_bomb_is_never_unfolded():
    levels = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)]
    bomb = "\n".join(["a0: &a0 [lol]", *levels])
    found = parse_document(bomb.encode(), "f").problems
    assert [str(each) for each in found] == [f"f:1: file: expected a plain value, got &a0: {PLAIN}"]


class TestFiles:
    def test_a_missing_file(self, tmp_path):
        path = tmp_path / "none.yaml"
        with pytest.raises(SettingsError, match=r"none\.yaml:1: file: expected a readable file: there is none"):
            read_document(path)

    def test_a_folder(self, tmp_path):
        with pytest.raises(SettingsError, match="file: expected a regular file, got a folder, a pipe or a device"):
            read_document(tmp_path)

    def test_a_pipe_that_nobody_writes_to(self, tmp_path):
        path = tmp_path / "pipe"
        os.mkfifo(path)
        with pytest.raises(SettingsError, match="file: expected a regular file, got a folder, a pipe or a device"):
            read_document(path)

    def test_a_device(self, tmp_path):
        path = tmp_path / "zero"
        path.symlink_to("/dev/zero")
        with pytest.raises(SettingsError, match="file: expected a regular file, got a folder, a pipe or a device"):
            read_document(path)

    def test_an_unreadable_file(self, write, monkeypatch):
        def refuse(*_arguments, **_options):
            raise PermissionError(13, "Permission denied")

        path = write("a: 1")
        monkeypatch.setattr(Path, "open", refuse)
        with pytest.raises(SettingsError, match="readable file: give the station's user the right to read it"):
            read_document(path)

    def test_a_huge_file(self, write):
        with pytest.raises(SettingsError, match="file: expected at most 64 KiB, got more"):
            read_document(write(b"#" * (64 * 1024 + 1)))
        assert read_document(write(b"#" * (64 * 1024))).value is None

    @pytest.mark.parametrize("name", ["a\0b", "x" * 5000, "loop"])
    def test_a_name_that_no_file_has(self, tmp_path, name):
        (tmp_path / "loop").symlink_to("loop")
        with pytest.raises(SettingsError, match="file: expected a readable file"):
            read_document(tmp_path / name)


YAML_BITS = st.sampled_from(
    ["a", "b: ", "- ", "\n", "\n  ", "? ", ": ", "[", "]", "{", "}", ",", "&x ", "*x", "!!int ", "|\n", ">", "'", '"',
     "#", "---\n", "...", "%YAML 1.1\n", "\t", "012", "NO", ".inf", "\\", "\\U", "FFFFFFFF", "\ufeff", "\u2028", "<<: "]
)  # fmt: skip


TEXTS = st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass"))
CONTENT = st.one_of(st.binary(max_size=200), TEXTS,
                    st.lists(YAML_BITS, max_size=40).map(lambda bits: "".join(bits).encode()))  # fmt: skip


def test_a_file_that_the_libraries_read_in_two_ways_is_not_edited():
    assert parse_document(b">\n#", "f").value == ""
    with pytest.raises(SettingsError, match="two ways"):
        CommentedText(b">\n#", "f")


@settings(max_examples=400, deadline=None)
@given(CONTENT)
def test_whatever_the_bytes_there_is_a_document_and_problems_with_places(content):
    document = parse_document(content, "f")
    last_line = content.count(b"\n") + content.count(b"\r") + content.decode("utf-8", "replace").count("\u2028") + 2
    for problem in document.problems:
        assert 1 <= int(str(problem.place).removeprefix("f:")) <= last_line + content.count(b"\x85")
        assert "\n" not in str(problem)


RECIPES = [*ROOT.glob("recipes/*.yaml"), *ROOT.glob("tests/recipe_store/golden/*/*.yaml")]


def by_ruamel(content):
    """Read by ruamel.yaml, which rewrites edited files, as YAML 1.2."""
    return YAML(typ="safe", pure=True).load(content.decode("utf-8-sig"))


def is_read_alike(content):
    """Return whether a content is accepted; if so, check that ruamel.yaml finds the same data or refuses it."""
    document = parse_document(content, "f")
    if document.problems:
        return False
    if isinstance(document.value, str):  # a file that is one text: what edits files refuses it where they differ
        with contextlib.suppress(SettingsError):
            assert CommentedText(content, "f").values == document.value
        return True
    with contextlib.suppress(YAMLError, ValueError):  # it takes `_` for a number, and fails
        assert repr(by_ruamel(content)) == repr(document.value)  # also the types: 1 == True == 1.0
    return True


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_recipe_is_the_same_data_for_both_yaml_libraries(path):
    content = path.read_bytes()
    assert is_read_alike(content)
    assert by_ruamel(content) == parse_document(content, "f").value


@pytest.mark.parametrize("content", [content for content, _ in BAD.values()], ids=BAD)
def test_a_nasty_file_is_refused_whatever_the_other_library_makes_of_it(content):
    assert not is_read_alike(content if isinstance(content, bytes) else content.encode())


@settings(max_examples=400, deadline=None)
@given(CONTENT)
def test_whatever_is_accepted_is_the_same_data_for_both_yaml_libraries(content):
    is_read_alike(content)


@settings(max_examples=400, deadline=None)
@given(st.from_regex(r"[-+0-9a-zA-Z.:_~=<]{1,12}", fullmatch=True))
def test_a_word_that_is_accepted_is_the_same_for_both_yaml_libraries(word):
    is_read_alike(f"a: {word}\n".encode())
    is_read_alike(f"{word}: 1\n".encode())
