"""Stories: what is done to which link at which fruit, drawn from a seed."""

import random
from enum import StrEnum
from typing import NamedTuple

from .proxy import Kind, Way
from .routes import LinkName

FRUITS = 50
"""Of one story, but for the last ones."""
LAST_FRUITS = 2
"""Sound ones at a story's end, which nothing is done to: every one has to pass."""
_DISTURBED = 0.65
_BRUISED = 0.3
_LINKS = {
    LinkName.RTDE: 5,
    LinkName.SCRIPT: 1,
    LinkName.URCAP: 5,
    LinkName.CAMERA: 5,
    LinkName.MODBUS: 5,
    LinkName.CHANNEL: 5,
}
"""How often each is disturbed. The script's and the dashboard's ports are idle but for a start of the arm's driver."""
_LASTS_S = {
    Kind.DELAY: (0.3, 2.5),
    Kind.STALL: (0.1, 4.0),
    Kind.CUT_FIN: (0.0, 1.5),
    Kind.CUT_RST: (0.0, 1.5),
    Kind.SPLIT: (0.3, 2.5),
    Kind.REPEAT: (0.5, 0.5),
    Kind.CORRUPT: (0.5, 0.5),
    Kind.TRUNCATE: (0.5, 0.5),
}
"""Shortest and longest; of the last three how long a segment is waited for."""
_LONGEST_AFTER_S = 3.0
"""From the accepted trigger to a disturbance of the inspection: the quick recipe's cycle."""


class Moment(StrEnum):
    """When the disturbance begins."""

    IDLE = "idle"
    """With no fruit; the trigger comes once it is over."""
    TRIGGER = "trigger"
    """With the trigger."""
    INSPECTION = "inspection"
    """At random within 3 s after the accepted trigger."""
    RESULT = "result"
    """Once the result can be read."""


class Planned(NamedTuple):
    """One disturbance to come."""

    link: LinkName
    kind: Kind
    way: Way
    moment: Moment
    after_s: float
    """The accepted trigger, for the moment `inspection`."""
    lasts_s: float
    seed: int
    """Of the bytes that are changed."""

    def __str__(self) -> str:
        """One line for a person."""
        return f"{self.link} {self.kind} {self.way} at {self.moment} +{self.after_s:.2f} s for {self.lasts_s:.2f} s"


class Plan(NamedTuple):
    """One fruit."""

    bruised: bool
    disturbance: Planned | None


def draw(seed: int, fruits: int = FRUITS) -> list[Plan]:
    """Return the story of a seed.

    Args:
        seed: its number.
        fruits: how many, before the last ones.
    """
    chance = random.Random(seed)
    return [_plan(chance) for _ in range(fruits)] + [Plan(bruised=False, disturbance=None)] * LAST_FRUITS


def _plan(chance: random.Random) -> Plan:
    bruised = chance.random() < _BRUISED
    if chance.random() >= _DISTURBED:
        return Plan(bruised, None)
    (link,) = chance.choices(list(_LINKS), list(_LINKS.values()))
    kind, way = chance.choice(list(Kind)), chance.choice(list(Way))
    if link is LinkName.CAMERA:
        way = Way.TO_STATION  # the other way carries one request for each connection
    moment = chance.choice((Moment.IDLE, Moment.TRIGGER, Moment.INSPECTION, Moment.INSPECTION, Moment.RESULT))
    after_s = chance.uniform(0.0, _LONGEST_AFTER_S) if moment is Moment.INSPECTION else 0.0
    return Plan(
        bruised, Planned(link, kind, way, moment, after_s, chance.uniform(*_LASTS_S[kind]), chance.getrandbits(32))
    )
