"""Stored results of each story of disturbed links: a line of JSON for each fruit, and one for the story's end."""

from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict

ONE_OUTCOME = "one outcome for each accepted trigger"
NONE_STALE = "no outcome of another fruit is used"
NONE_DOUBLED = "no outcome is shown twice or changed"
WHOLE_PRESS = "no PASS without a whole trusted press, or of a bruised fruit"
NOTHING_MOVES = "nothing moves in a held state"
ALARMS_RETURN = "alarms return to normal, and the line runs again"
LAWS = (ONE_OUTCOME, NONE_STALE, NONE_DOUBLED, WHOLE_PRESS, NOTHING_MOVES, ALARMS_RETURN)


class Fruit(BaseModel):
    """One fruit, and what came of its disturbance. Times in seconds; None where it did not happen."""

    model_config = ConfigDict(extra="forbid")

    seed: int
    number: int
    """Of the fruit in its story."""
    bruised: bool
    link: str = ""
    """Empty for no disturbance."""
    kind: str = ""
    way: str = ""
    moment: str = ""
    plan: str = ""
    """The disturbance in a line."""
    touched: int = 0
    """Segments and connections that it met."""
    outcome: str = ""
    """The PLC's decision."""
    reasons: tuple[str, ...] = ()
    alarms: tuple[str, ...] = ()
    signs: tuple[str, ...] = ()
    """Signs of a fault at the interface, in their order."""
    detected_s: float | None = None
    """From the disturbance's begin to the first sign."""
    safe_s: float | None = None
    """From the first sign until no trigger would be accepted."""
    ready_s: float | None = None
    """From the disturbance's end, or the PLC's decision where that was later, to ready again."""
    remedies: tuple[str, ...] = ()
    """A person's."""
    misled: tuple[str, ...] = ()
    """What a corruption that its protocol cannot show made of a value."""
    broken: tuple[tuple[str, str], ...] = ()
    """Laws that did not hold, and how."""
    took_s: float = 0.0


class Story(BaseModel):
    """All of one story."""

    model_config = ConfigDict(extra="forbid")

    seed: int
    fruits: tuple[Fruit, ...] = ()
    triggers: int = 0
    broken: tuple[tuple[str, str], ...] = ()
    """Laws that did not hold at its end, or because it came to nothing."""
    ended: bool = False
    """False where it was interrupted."""

    @property
    def all_broken(self) -> list[tuple[int, str, str]]:
        """Number of the fruit, 0 for the end; law; how."""
        of_fruits = [(fruit.number, *each) for fruit in self.fruits for each in fruit.broken]
        return [*of_fruits, *((0, *each) for each in self.broken)]


class Results(BaseModel):
    """All that was measured."""

    model_config = ConfigDict(extra="forbid")

    stories: tuple[Story, ...] = ()

    @property
    def fruits(self) -> list[Fruit]:
        """Those of all stories."""
        return [fruit for story in self.stories for fruit in story.fruits]


def read(file: Path) -> Results:
    """Read what was stored; nothing where there is no file."""
    return Results.model_validate_json(file.read_text(encoding="utf-8")) if file.exists() else Results()


def write(file: Path, stories: Sequence[Story]) -> None:
    """Store stories, in the order of their seeds."""
    ordered = tuple(sorted(stories, key=lambda story: story.seed))
    new = file.with_suffix(".new")
    new.write_text(Results(stories=ordered).model_dump_json(indent=0, exclude_defaults=True) + "\n", encoding="utf-8")
    new.replace(file)
