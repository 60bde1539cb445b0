"""Parts of the data on the constants' page: described in the words of the benchmark that writes it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_pages_words_on_the_data_sets_are_the_benchmarks():
    source = (ROOT / "benchmarks" / "bench_fit.py").read_text(encoding="utf-8")
    words = source.split('COST = """')[1].split('"""')[0].strip()
    assert words in (ROOT / "docs" / "robust-constants.md").read_text(encoding="utf-8")


def test_no_page_claims_that_nothing_was_chosen_on_the_part_by_which_values_are_taken():
    guide = (ROOT / "docs" / "developer.md").read_text(encoding="utf-8")
    assert "If both parts gain, change the default" in guide
    for name in ("robust-constants.md", "robust.md"):
        words = " ".join((ROOT / "docs" / name).read_text(encoding="utf-8").split())
        assert "nothing is chosen" not in words
        assert "nothing was chosen" not in words
