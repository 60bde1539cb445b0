"""Plays of the handshake stay what they were, to every register, action and timer."""

import zlib
from pathlib import Path

import pytest

from tests.plc_interface.handshake.played_handshake import Play

GOLDEN = Path(__file__).parent / "golden"
"""`python -m tests.plc_interface.handshake.test_played_handshake` writes them anew: then check each difference."""
SEEDS = range(8)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_play_goes_as_it_went(seed):
    golden = (GOLDEN / f"play_{seed}.txt").read_text(encoding="utf-8").splitlines()
    for number, (now, then) in enumerate(zip(Play(seed).run(), golden, strict=True)):
        assert short(now) == then, f"step {number}: {now}"


def short(line: str) -> str:
    """Time and event of a step, and a checksum of all that followed from it."""
    return f"{line.partition('(')[0]} {zlib.crc32(line.encode()):08x}"


if __name__ == "__main__":
    GOLDEN.mkdir(exist_ok=True)
    for seed in SEEDS:
        lines = [short(line) for line in Play(seed).run()]
        (GOLDEN / f"play_{seed}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
