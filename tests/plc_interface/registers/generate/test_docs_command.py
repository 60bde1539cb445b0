"""`station plc docs`, and that what is in the repository is what it makes."""

import subprocess
import sys

import pytest

from plc_interface.registers.generate import files
from plc_interface.registers.generate.files import drifted_files, made_files, write_files
from station.errors import BadInputError


def test_the_repositorys_files_are_what_the_map_says():
    folder = files.DOCUMENTS
    assert [str(path) for path in drifted_files(folder)] == [], "run: station plc docs"


def docs(*arguments):
    command = [sys.executable, "-m", "station", "plc", "docs", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert "Traceback" not in done.stderr
    return done


def test_it_writes_says_so_and_then_has_nothing_to_do(tmp_path):
    first = docs("--out", tmp_path / "made")
    assert first.returncode == 0
    assert first.stdout.count("wrote ") == len(made_files())
    assert (tmp_path / "made" / "register-map.csv").read_text("utf-8").startswith("name,pdu_address,")
    second = docs("--out", tmp_path / "made")
    assert (second.returncode, second.stdout.count("nothing to write")) == (0, 1)


@pytest.mark.parametrize("spoil", ["changed", "missing"])
def test_a_drift_is_named_and_ends_with_1(tmp_path, spoil):
    write_files(tmp_path)
    victim = tmp_path / "register-map.md"
    victim.unlink() if spoil == "missing" else victim.write_text("by hand")
    done = docs("--check", "--out", tmp_path)
    assert done.returncode == 1
    assert "register-map.md; run `station plc docs`" in done.stderr
    assert victim.exists() == (spoil == "changed")


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    done = docs("--out", tmp_path / "file")
    assert done.returncode == 2
    assert "--out" in done.stderr


def test_without_the_repository_a_folder_has_to_be_given(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "DOCUMENTS", tmp_path / "docs" / "plc")
    with pytest.raises(BadInputError, match="--out"):
        write_files(files.DOCUMENTS)
