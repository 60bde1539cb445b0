"""Nest: the place of the fruit during its inspection, and the supply of fruit."""

import asyncio
import json
import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from station.errors import StationError

GRADER_ERROR_MM = 1.0
"""Largest error of a length; an estimate of what an optical sizer resolves on soft fruit, no source found."""
SEVERITIES = ("severe", "mild", "patch")
"""Severities of damage, by the names of the twin's console."""
_ANSWER_LIMIT_S = 5.0
_LOOPBACK = "127.0.0.1"
_SEEDS = 2**31


@dataclass(frozen=True, slots=True)
class LaidFruit:
    """The fruit in the nest, as far as it is known."""

    kind: str
    """Empty if it is unknown."""
    damaged: bool | None
    """The truth, None if it is unknown."""
    recipe: int
    """The number of its recipe; 0 for the active one."""
    length_mm_x10: int = 0
    """Its length as the grader measured it, tenths of a millimetre; 0 where none did."""


class Grader:
    """Upstream grader: measures the length of every fruit, with an error drawn by a seed evenly from its bounds."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)  # noqa: S311 (a simulation)

    def length_mm_x10(self, true_mm: float) -> int:
        """Return the measured length, tenths of a millimetre."""
        return round(10 * (true_mm + self._random.uniform(-GRADER_ERROR_MM, GRADER_ERROR_MM)))


class Nest(Protocol):
    """Brings fruit and takes it away."""

    async def arrive(self) -> LaidFruit:
        """Lay the next fruit, in the place of one that has not left."""
        ...

    async def leave(self) -> None:
        """Take the fruit away."""
        ...


class RealNest:
    """Nest that people or a line fill: nothing is known of its fruit."""

    async def arrive(self) -> LaidFruit:
        """Take for granted that a fruit is there."""
        return LaidFruit("", None, 0)

    async def leave(self) -> None:
        """Do nothing: people or the line take the fruit away."""


class TwinNest:
    """Nest of the simulated world, filled through its console.

    Args:
        console_port: of the twin, on the loopback.
        recipes: the recipe's number of each kind of fruit, which is drawn from at random.
        damaged_share: of the fruit, from 0 to 1.
        seed: the same gives the same fruits.
        graded: whether an upstream grader measures their length.
        severity: of the damage, one of `SEVERITIES`.
    """

    def __init__(
        self,
        console_port: int,
        recipes: Mapping[str, int],
        damaged_share: float,
        seed: int,
        *,
        graded: bool = True,
        severity: str = SEVERITIES[0],
    ) -> None:
        self._severity = severity
        self._grader = Grader(seed) if graded else None
        self._port, self._recipes, self._damaged_share = console_port, dict(recipes), damaged_share
        self._random = random.Random(seed)  # noqa: S311 (a simulation)

    async def arrive(self) -> LaidFruit:
        """Lay the next fruit.

        Raises:
            StationError: the twin does not answer, or refuses.
        """
        kind = self._random.choice(list(self._recipes))
        damaged = self._random.random() < self._damaged_share
        seed = self._random.randrange(_SEEDS)
        how = {"bruised": damaged, "severity": self._severity}
        await self._ask({"do": "fruit", "kind": kind, "seed": seed, **how})
        graded = 0
        if self._grader is not None:
            graded = self._grader.length_mm_x10((await self._ask({"do": "state"}))["fruit_length_mm"])
        return LaidFruit(kind, damaged, self._recipes[kind], graded)

    async def leave(self) -> None:
        """Empty the nest.

        Raises:
            StationError: the twin does not answer.
        """
        await self._ask({"do": "remove"})

    async def _ask(self, request: dict[str, Any]) -> Any:
        try:
            async with asyncio.timeout(_ANSWER_LIMIT_S):
                reader, writer = await asyncio.open_connection(_LOOPBACK, self._port)
                try:
                    writer.write(json.dumps(request).encode() + b"\n")
                    answer = json.loads(await reader.readline())
                finally:
                    writer.close()
                    await writer.wait_closed()
        except (OSError, ValueError) as error:
            raise StationError(
                f"the twin's console at {_LOOPBACK}:{self._port} does not answer: {error}; is `station twin` running?"
            ) from error
        if not answer.get("ok"):
            raise StationError(f"the twin refused {request['do']}: {answer.get('error')}")
        return answer["result"]
