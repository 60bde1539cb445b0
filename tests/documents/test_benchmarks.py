"""The summary of the benchmarks: its figures are those of the pages, and none is read from the wrong row."""

import json

import pytest

from benchmarks import runner, summary

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


def test_the_list_says_how_long_each_took(benches, capsys):
    (benches.parent / "bench_endless.py").write_text('"""What never ends."""\n')
    assert runner.main(["three", "one"]) == 0
    assert runner.main(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["endless", "one", "three", "two"]
    assert "long" in lines[0]
    assert "0.0 min  What one does." in lines[1]
    assert runner.main(["four"]) == 2
