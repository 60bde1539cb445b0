"""The loader refuses what is doubtful, with the line, and reads the rest as YAML 1.2 does."""

import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.settings import yaml_loader
from station.settings.problems import SettingsError
from station.settings.yaml_loader import parse_document, read_document

ALIKE = "f:1: a: expected a value that YAML 1.1 and 1.2 read alike, got"
BAD = {
    "doubled key": ("a: 1\nb: 2\na: 3\n", ["f:3: a: expected once, got it again: it is on line 1 already"]),
    "doubled in a list": (
        "l:\n  - x: 1\n    x: 2\n",
        ["f:3: l[0].x: expected once, got it again: it is on line 2 already"],
    ),
    "NO": ("a: NO", [f'{ALIKE} NO: write true or false, or "NO" in quotes for a text']),
    "yes": ("a: yes", [f'{ALIKE} yes: write true or false, or "yes" in quotes for a text']),
    "octal": ("a: 012", [f'{ALIKE} 012: write it without the leading zero, or "012" in quotes for a text']),
    "no octal": ("a: 09", [f'{ALIKE} 09: write it without the leading zero, or "09" in quotes for a text']),
    "octal 1.2": ("a: 0o17", [f'{ALIKE} 0o17: write a number in plain decimal digits, or "0o17" in quotes for a text']),
    "exponent": ("a: 1e3", [f'{ALIKE} 1e3: write the number without an exponent, or "1e3" in quotes for a text']),
    "huge exponent": (
        "a: 1e999",
        [f'{ALIKE} 1e999: write a number in plain decimal digits, or "1e999" in quotes for a text'],
    ),
    "sexagesimal": (
        "a: 1:30",
        [f'{ALIKE} 1:30: write a number in plain decimal digits, or "1:30" in quotes for a text'],
    ),
    "underscore": (
        "a: 1_000",
        [f'{ALIKE} 1_000: write a number in plain decimal digits, or "1_000" in quotes for a text'],
    ),
    "date": (
        "a: 2025-01-31",
        [f'{ALIKE} 2025-01-31: write "2025-01-31" in quotes for a text'],
    ),
    "date and time": (
        "a: 2025-01-31T12:30:00Z",
        [f'{ALIKE} 2025-01-31T12:30:00Z: write "2025-01-31T12:30:00Z" in quotes for a text'],
    ),
    "NaN": ("a: .nan", ["f:1: a: expected a finite number, got .nan"]),
    "infinity": ("a:\n  - -.Inf", ["f:2: a[0]: expected a finite number, got -.Inf"]),
    "overflow": ("a: 1.0e+999", ["f:1: a: expected a finite number, got 1.0e+999"]),
    "many digits": ("a: " + "9" * 5000, ["f:1: a: expected a number of at most 40 characters, got 5000"]),
    "huge integer": (
        "a: 1000000000000000001",
        ["f:1: a: expected a number of at most 18 digits, got 1000000000000000001"],
    ),
    "key on": (
        "on: 1",
        [f'{ALIKE} on: write true or false, or "on" in quotes for a text'.replace("f:1: a", "f:1: on")],
    ),
    "key number": ("1: x", ["f:1: 1: expected a key that is a text, got 1"]),
    "key nothing": ("? \n: x", ["f:1: ?: expected a key that is a text, got nothing"]),
    "key list": ("? [a]\n: x", ["f:1: file: expected a key that is a plain text"]),
    "anchor and alias": (
        "a: &x 1\nb: *x\n",
        ["f:1: a: expected no anchor, got &x: remove it", "f:2: b: expected a value, got the alias *x: write it out"],
    ),
    "merge": (
        "a: {}\nb:\n  <<: {c: 1}\n",
        ["f:3: b: expected a key, got the merge key <<: write the entries out"],
    ),
    "python tag": (
        "a: !!python/object/apply:os.system [ls]\n",
        ["f:1: a: expected no tag, got tag:yaml.org,2002:python/object/apply:os.system: remove it"],
    ),
    "own tag": ("a: !x 1", ["f:1: a: expected no tag, got !x: remove it"]),
    "two documents": (
        "a: 1\n---\na: 2\n",
        ["f:2: file: expected one YAML document, got a second one: remove the '---'"],
    ),
    "tab": ("a:\n\tb: 1\n", ["f:2: file: expected spaces, got a tab"]),
    "broken": ("a: [1, 2\nb: 3\n", ["f:2: file: expected valid YAML: expected ',' or ']', but got ':'"]),
    "broken after a problem": (
        "a: NO\nb: ]\n",
        [
            f'{ALIKE} NO: write true or false, or "NO" in quotes for a text',
            "f:2: file: expected valid YAML: while parsing a block mapping",
        ],
    ),
    "not UTF-8": (b"a: 1\nb: \xff\n", ["f:2: file: expected UTF-8 text, got the byte 0xff"]),
    "UTF-16": ("a: 1".encode("utf-16"), ["f:1: file: expected UTF-8 text, got the byte 0xff"]),
    "control character": (b"a: 1\nb: \x07\n", ["f:2: file: expected printable text, got a control character"]),
    "beyond Unicode": ('a:\n  b: "\\UFFFFFFFF"\n', ["f:2: file: expected characters that exist in Unicode"]),
    "half a character": ('a: "\\ud800"', ["f:1: a: expected characters that exist in Unicode"]),
    "deep": ("a: " + "[" * 30_000, ["f:1: a[0][0]: expected at most 12 levels of nesting"]),
    "many": ("[" + "1," * 6000 + "]", ["f:1: file: expected at most 5000 values"]),
}


@pytest.mark.parametrize(("content", "expected"), BAD.values(), ids=BAD)
def test_what_is_doubtful_is_refused_with_its_place(content, expected):
    content = content if isinstance(content, bytes) else content.encode()
    found = [str(problem) for problem in parse_document(content, "f").problems]
    if "while parsing" in expected[-1]:
        assert found[:-1] == expected[:-1]
        assert found[-1].startswith("f:2: file: expected valid YAML: ")
    else:
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
    assert document.locate(("b", 1, "z")) == ("f:5", "b[1].z")


@pytest.mark.parametrize("content", [b"", b"# only a comment\n", b"---\n", b"\n\n"])
def test_nothing_at_all_is_none(content):
    assert parse_document(content, "f").value is None
    assert not parse_document(content, "f").problems


def test_an_anchor_bomb_is_never_unfolded():
    levels = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)]
    bomb = "\n".join(["a0: &a0 [lol]", *levels])
    found = parse_document(bomb.encode(), "f").problems
    assert len(found) == yaml_loader.MOST_PROBLEMS
    assert str(found[0]) == "f:1: a0: expected no anchor, got &a0: remove it"
    assert found[-1].expected == "and more: mend these first"


class TestFiles:
    def test_a_missing_file(self, tmp_path):
        path = tmp_path / "none.yaml"
        with pytest.raises(SettingsError, match=r"none\.yaml:1: file: expected a readable file: no such file"):
            read_document(path)

    def test_a_folder(self, tmp_path):
        with pytest.raises(SettingsError, match="file: expected a regular file, got a folder"):
            read_document(tmp_path)

    def test_a_pipe_that_nobody_writes_to(self, tmp_path):
        path = tmp_path / "pipe"
        os.mkfifo(path)
        with pytest.raises(SettingsError, match="file: expected a regular file, got a pipe"):
            read_document(path)

    def test_a_device(self, tmp_path):
        path = tmp_path / "zero"
        path.symlink_to("/dev/zero")
        with pytest.raises(SettingsError, match="file: expected a regular file, got a device"):
            read_document(path)

    def test_an_unreadable_file(self, write, monkeypatch):
        def refuse(*_arguments, **_options):
            raise PermissionError(13, "Permission denied")

        path = write("a: 1")
        monkeypatch.setattr(yaml_loader.os, "open", refuse)
        with pytest.raises(SettingsError, match="permission denied: give the station's user the right to read it"):
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


@settings(max_examples=400, deadline=None)
@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")),
                 st.lists(YAML_BITS, max_size=40).map(lambda bits: "".join(bits).encode())))  # fmt: skip
def test_whatever_the_bytes_there_is_a_document_and_problems_with_places(content):
    document = parse_document(content, "f")
    last_line = content.count(b"\n") + content.count(b"\r") + content.decode("utf-8", "replace").count("\u2028") + 2
    for problem in document.problems:
        assert 1 <= int(problem.place.removeprefix("f:")) <= last_line + content.count(b"\x85")
        assert "\n" not in str(problem)
