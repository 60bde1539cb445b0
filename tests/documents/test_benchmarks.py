"""The summary of the benchmarks: its figures are those of the pages, and none is read from the wrong row."""

import contextlib
import json

import pytest

from benchmarks import against, runner, summary

PAGE = """
| server | clients | p99 |
|---|---|---|
| ours | 1 | 5 |
| ours | 32 | 7 |

Between them, a load
average of 1.5.

| server | clients | replies |
|---|---|---|
| ours | 1 | 900 |
"""


def test_the_page_is_what_the_benchmarks_pages_say_now():
    assert summary.DOCUMENT.read_text("utf-8") == summary.markdown(summary.read_runs()), (
        "renew it: .venv/bin/python -m benchmarks.summary"
    )


def test_every_benchmark_is_in_the_table(root):
    assert {path.stem for path in (root / "benchmarks").glob("bench_*.py")} == {
        f"bench_{name}" for name in summary.BENCHMARKS
    }


def test_a_cell_is_found_by_its_row_and_the_columns_of_its_table():
    assert summary.find(PAGE, {"p99"}, "ours | 32 |", "p99") == "7"
    assert summary.find(PAGE, {"clients", "replies"}, "ours", "replies") == "900"
    assert summary.load(PAGE) == "1.5"


def test_a_part_made_on_another_day_has_its_own_load():
    page = f"# Page\n{PAGE}\n## Another\n\n| where | s |\n|---|---|\n| two | 3 |\n\nLoad 0.5.\n"
    assert summary.load(summary.section(page, "time, s", "s", "two")) == "0.5"
    assert summary.load(summary.section(page, "replies a second", "replies", "ours")) == "1.5"


@pytest.mark.parametrize(("row", "column"), [("ours", "p99"), ("theirs", "p99"), ("ours", "p50")])
def test_a_row_that_is_missing_or_not_the_only_one_is_an_error(row, column):
    with pytest.raises(LookupError, match="rows begin with"):
        summary.find(PAGE, {column}, row, column)


@pytest.fixture
def benches(tmp_path, monkeypatch):
    """Three small benchmarks, the second of which fails, with a page that shows what the others wrote."""
    page, log = tmp_path / "page.md", tmp_path / "log"
    for name, code in ("one", 0), ("two", 3), ("three", 0):
        source = f"open({str(log)!r}, 'a').write({name!r} + ' '.join(sys.argv[1:]) + ';')\nsys.exit({code})\n"
        (tmp_path / f"bench_{name}.py").write_text(f'"""What {name} does."""\nimport sys\n{source}')
    monkeypatch.setattr(runner, "FOLDER", tmp_path)
    monkeypatch.setattr(runner, "BENCHMARKS", {"one": {}, "two": {}, "three": {}, "endless": {"long": True}})
    monkeypatch.setattr(summary, "RUNS", tmp_path / "runs.json")
    monkeypatch.setattr(summary, "DOCUMENT", page)
    return log


def test_a_run_of_all_leaves_out_the_long_ones_and_goes_on_after_a_failure(benches, capfd):
    assert runner.main([]) == 1
    assert benches.read_text() == "one;three;two;"
    assert set(json.loads(summary.RUNS.read_text())) == {"one", "three"}
    assert capfd.readouterr().err.endswith("failed: two\n")
    assert summary.DOCUMENT.exists()


def test_a_run_with_options_is_none_of_the_whole(benches):
    assert runner.main(["one", "--small"]) == 0
    assert benches.read_text() == "one--small;"
    assert not summary.RUNS.exists()


def test_a_benchmark_has_one_thread_for_matrix_products_however_it_is_begun(benches, tmp_path, monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    page = tmp_path / "threads"
    source = f'"""Threads."""\nimport os\nopen({str(page)!r}, "w").write(os.environ["OPENBLAS_NUM_THREADS"])\n'
    (tmp_path / "bench_one.py").write_text(source)
    assert runner.main(["one"]) == 0
    assert page.read_text() == "1"


def test_the_list_says_how_long_each_took(benches, capsys):
    (benches.parent / "bench_endless.py").write_text('"""What never ends."""\n')
    assert runner.main(["three", "one"]) == 0
    assert runner.main(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["endless", "one", "three", "two"]
    assert "long" in lines[0]
    assert "0.0 min  What one does." in lines[1]
    assert runner.main(["four"]) == 2


def test_the_page_of_earlier_revisions_is_what_was_found():
    assert against.DOCUMENT.read_text("utf-8") == against.markdown(against.read())


@pytest.fixture
def revisions(tmp_path, monkeypatch):
    """Two checkouts with a benchmark that counts its runs into its page; the earlier one has no second figure."""
    shared = tmp_path / "runs"
    shared.write_text("")
    for place, row in ("earlier", ""), ("now", "| ours, new | {at} |\\n"):
        source = (
            "import pathlib\n"
            f"runs = pathlib.Path({str(shared)!r})\n"
            f"runs.write_text(runs.read_text() + {place[0]!r})\n"
            "at = len(runs.read_text())\n"
            f"page = pathlib.Path('{tmp_path}/{place}/docs/page.md')\n"
            f"page.write_text(f'| | ms |\\n|---|---|\\n| ours | {{at}} |\\n{row}')\n"
        )
        for folder in "benchmarks", "docs":
            (tmp_path / place / folder).mkdir(parents=True)
        (tmp_path / place / "benchmarks" / "bench_one.py").write_text(source)
        (tmp_path / place / "docs" / "page.md").write_text("| | ms |\n|---|---|\n| ours | 0 |\n| ours, new | 0 |\n")
    figures = [["time, ms", "ms", "ours |"], ["new time, ms", "ms", "ours, new"]]
    for module in against, runner, summary:
        monkeypatch.setattr(module, "BENCHMARKS", {"one": {"page": "page.md", "figures": figures}})
    for module in against, summary:
        monkeypatch.setattr(module, "ROOT", tmp_path / "now")
    monkeypatch.setattr(runner, "FOLDER", tmp_path / "now" / "benchmarks")
    monkeypatch.setattr(summary, "RUNS", tmp_path / "runs.json")
    monkeypatch.setattr(summary, "DOCUMENT", tmp_path / "benchmarks.md")
    monkeypatch.setattr(against, "FOUND", tmp_path / "found.json")
    monkeypatch.setattr(against, "DOCUMENT", tmp_path / "page.md")
    monkeypatch.setattr(against, "checked_out", lambda _: contextlib.nullcontext(tmp_path / "earlier"))
    return shared


def test_two_revisions_run_in_turn_and_only_what_both_have_is_compared(revisions):
    assert runner.main(["--against", "v1", "one"]) == 0
    assert against.DOCUMENT.read_text().splitlines()[-1] == "| `one` | v1 | time, ms | 1 | 2 |"
    assert runner.main(["--against", "v1", "one"]) == 0
    assert revisions.read_text() == "enne"
    assert against.DOCUMENT.read_text().splitlines()[-1] == "| `one` | v1 | time, ms | 1; 4 | 2; 3 |"
    assert runner.main(["--against", "v2", "one"]) == 0
    assert against.DOCUMENT.read_text().splitlines()[-1] == "| `one` | v2 | time, ms | 5 | 6 |"


def test_the_run_of_now_is_noted_as_any_other(revisions):
    assert runner.main(["--against", "v1", "one"]) == 0
    assert list(summary.read_runs()) == ["one"]
    assert "| [one](page.md) | time, ms | 2 |" in summary.DOCUMENT.read_text()


def test_a_benchmark_that_fails_ends_the_comparison_and_changes_no_page(revisions, tmp_path):
    (tmp_path / "now" / "benchmarks" / "bench_one.py").write_text("raise SystemExit(3)")
    assert runner.main(["--against", "v1", "one"]) == 1
    assert not against.DOCUMENT.exists()


def test_a_comparison_without_a_benchmark_is_refused(revisions):
    assert runner.main(["--against", "v1"]) == runner.main(["--against", "v1", "two"]) == 2
