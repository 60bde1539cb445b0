"""The commands that the documents name exist as they stand there, and console blocks answer what is written."""

import contextlib
import functools
import io
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import pytest
from markdown_it import MarkdownIt

from station.cli import cli, main

pytestmark = pytest.mark.timeout(900)  # every command's module is imported, and some are carried out

PLACEHOLDER = re.compile(r"[A-Z][A-Z0-9_]*$|.*…")
BY_HAND = {"docs/plc/quick-start.md"}
"""Documents whose console blocks another test runs, against a PLC interface."""
DEADLINE_S = 120


def documents_with_console():
    root = Path(__file__).resolve().parents[2]
    files = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    tokens = ((file, MarkdownIt().parse(file.read_text("utf-8"))) for file in files)
    names = {f.relative_to(root).as_posix() for f, all_ in tokens for t in all_ if t.info.startswith("console")}
    return sorted(names - BY_HAND)


def check_values(command, context, values, *, whole):
    """Raise where a value is missing, or no choice or number of its parameter."""
    given = {name: value for name, value in values.items() if isinstance(value, str | list | tuple) and value}
    for parameter in command.params:
        value = given.get(str(parameter.name), ())
        if not value and parameter.required and whole and not values.get("help"):
            raise click.UsageError(f"{parameter.human_readable_name} is missing")
        convert: Any = parameter.type.convert
        if isinstance(parameter.type, click.Choice | click.types.IntParamType | click.types.FloatParamType):
            for each in [value] if isinstance(value, str) else value:
                if isinstance(each, str) and not PLACEHOLDER.match(each):
                    convert(each, parameter, context)


def station_problem(command, words, *, whole):
    """Return the fault of a command line, without carrying it out; None if there is none."""
    context = click.Context(command, info_name=command.name)
    try:
        values, rest, _ = command.make_parser(context).parse_args(list(words))
        check_values(command, context, values, whole=whole)
    except click.UsageError as error:
        cut_short = isinstance(error, click.BadOptionUsage) and not whole
        return None if cut_short else error.format_message()
    if not isinstance(command, click.Group):
        return f"too many words: {rest}" if rest else None
    if rest:
        inner = command.get_command(context, rest[0])
        return f"no command {rest[0]}" if inner is None else station_problem(inner, rest[1:], whole=whole)
    wanting = whole and not command.invoke_without_command and not values.get("help")
    return "a subcommand is missing" if wanting else None


@functools.cache
def run_commands(root):
    return frozenset(runpy.run_path(str(root / "run"))["COMMANDS"])


def problem(words, root, *, whole):
    """Return the fault of a command of the project; None if there is none."""
    words = [word for word in words if word not in {"...", "…"}]
    if words[0] == "./run":
        if words[1:2] and words[1] not in run_commands(root):
            return f"./run has no {' '.join(words[1:2])}"
        if words[1:3] == ["bench", "--against"]:
            words = ["./run", "bench", *words[4:]]
        if words[1:2] == ["bench"] and len(words) > 2 and not PLACEHOLDER.match(words[2]):
            return None if (root / "benchmarks" / f"bench_{words[2]}.py").exists() else f"no benchmark {words[2]}"
        if words[1:2] not in (["station"], ["demo"]) or words[2:3] == ["ARGS"]:
            return None
        words = words[1:] if words[1] == "demo" else words[2:]
    else:
        words = words[1:]
    return station_problem(cli, words, whole=whole and bool(words))


def test_every_command_that_a_document_names_exists_as_it_stands_there(pages, root):
    commands = [command for page in pages.values() for command in page.commands]
    wrong = [f"{each}: {why}" for each in commands if (why := problem(each.words, root, whole=each.whole))]
    assert wrong == []
    assert len(commands) > 250


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("station brew", "no command"),
        ("station records shew 7", "no command"),
        ("station records list --colour red", "No such option"),
        ("station records list --last many", "not a valid integer"),
        ("station records list --outcome maybe", "is not one of"),
        ("station records show", "is missing"),
        ("station records hold 4711", "is missing"),
        ("station records show 7 8", "too many words"),
        ("./run brew", "has no brew"),
        ("./run bench coffee", "no benchmark"),
        ("./run demo --speed fast", "not a valid float"),
        ("station recipes", "a subcommand is missing"),
        ("station twin fault arm off --amount strong", "not a valid float"),
    ],
)
def test_a_command_that_does_not_exist_is_found(line, message, root):
    assert message in str(problem(shlex.split(line), root, whole=True))


def carried_out(command, folder, monkeypatch):
    """Exit code and output of a line of shell; a plain command of the station's runs in this process: it is faster."""
    words = shlex.split(command, comments=True)
    if words[:2] == ["./run", "station"]:
        words = words[1:]
    if words[0] == "station" and not set(command) & set("|&;<>$`"):
        output = io.StringIO()
        monkeypatch.setattr(sys, "argv", words)
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output), pytest.raises(SystemExit) as end:
            main()
        return end.value.code, output.getvalue()
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-c", command.replace("./run station", "station")],
        cwd=folder,
        env={**os.environ, "PATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    return done.returncode, done.stdout


def missing_lines(expected, output):
    """Lines of a document that do not come in the output, in their order; `…` matches anything."""
    lines = iter(" ".join(line.split()) for line in output.splitlines())
    missing = []
    for line in filter(None, (" ".join(line.split()) for line in expected)):
        pattern = re.compile(".*".join(map(re.escape, line.split("…"))))
        if line != "…" and not any(pattern.fullmatch(shown) for shown in lines):
            missing.append(line)
            break
    return missing


@pytest.mark.parametrize("name", documents_with_console())
def test_what_a_document_says_a_command_answers_it_answers(name, pages, home, tmp_path, monkeypatch, root):
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "recipes").symlink_to(root / "recipes")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("STATION_HOME", str(home))
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    for given in pages[name].console_commands:
        code, output = carried_out(given.command, folder, monkeypatch)
        place = f"{name}:{given.line}: {given.command}"
        assert code == given.code, f"{place}\n{output}"
        assert missing_lines(given.expected, output) == [], f"{place}\n{output}"


@pytest.mark.parametrize(
    ("expected", "whole"),
    [
        (["one 1", "three"], True),
        (["one …", "…ee"], True),
        (["…"], True),
        (["three", "one 1"], False),
        (["one"], False),
        (["one … 3"], False),
    ],
)
def test_an_answer_that_differs_from_the_document_is_found(expected, whole):
    assert (missing_lines(expected, "one   1\ntwo\nthree\n") == []) is whole
