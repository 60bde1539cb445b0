"""Results of each room's mutants, stored between runs; and the mutants that change nothing, with the reason."""

import json
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

FATES = Path(__file__).parent / "fates.json"
EQUAL = Path(__file__).parent / "equal.toml"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one room."""

    counts: dict[str, int]
    """Mutants by their fate."""
    alive: list[str]
    commit: str
    """That was tested."""
    of: int
    """Mutants that the room has in all."""


def load() -> dict[str, Outcome]:
    """Return the outcome of each room that was run."""
    if not FATES.exists():
        return {}
    return {name: Outcome(**fields) for name, fields in json.loads(FATES.read_text(encoding="utf-8")).items()}


def store(outcomes: dict[str, Outcome]) -> None:
    """Keep them."""
    text = json.dumps({name: asdict(outcome) for name, outcome in outcomes.items()}, indent=1, ensure_ascii=False)
    FATES.write_text(text + "\n", encoding="utf-8")


def equal() -> dict[str, str]:
    """Return the reason for each mutant that was found to change nothing, by its name."""
    if not EQUAL.exists():
        return {}
    groups = tomllib.loads(EQUAL.read_text(encoding="utf-8"))["equal"]
    return {name: group["reason"] for group in groups for name in group["mutants"]}
