"""Runner: measures trials in worker processes that share the data sets."""

import multiprocessing
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Self

import cv2

from fit.cost import Redrawn, cost
from fit.evaluation import Base, Scores, Trial, measure
from fit.parts import Groups
from fit.progress import report

_Job = tuple[int, Trial, Base | None]
_shared: list[Groups] = []


class Runner:
    """Worker processes, forked so that the images lie in memory once.

    Args:
        parts: the data sets to fit on, and those for validation.
        processes: how many; 1 measures in this process.
    """

    def __init__(self, parts: Sequence[Groups], processes: int) -> None:
        self.parts = list(parts)
        self.redrawn = [Redrawn(groups) for groups in parts]
        self._shipped: dict[int, Scores] = {}
        _shared[:] = parts
        context = multiprocessing.get_context("fork")
        self._pool = context.Pool(processes, cv2.setNumThreads, (1,)) if processes > 1 else None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._pool:
            self._pool.terminate()

    def run(self, name: str, trials: Sequence[Trial], part: int = 0, base: Base | None = None) -> list[Scores | None]:
        """The scores of each trial on one part; None of a trial whose constants make no method.

        Args:
            name: for the progress.
            trials: variants of the method.
            part: 0 to fit on, 1 for validation.
            base: on the same part; saves the measuring of what the trials do not change.
        """
        jobs = [(part, trial, base) for trial in trials]
        found: list[Scores | None] = []
        for scores in self._mapped(jobs):
            found.append(scores)
            if len(found) == len(jobs) or len(found) % 10 == 0:
                report(f"{name}: {len(found)} of {len(jobs)}")
        return found

    def shipped(self, part: int = 0) -> Scores:
        """The scores of the shipped constants, measured once."""
        if part not in self._shipped:
            self._shipped[part] = self.scores(Trial(), part)
        return self._shipped[part]

    def scores(self, trial: Trial, part: int) -> Scores:
        """The scores of one trial."""
        (scores,) = self.run("one trial", [trial], part)
        if scores is None:
            raise SystemExit("no method can be made with these constants")
        return scores

    def effect(self, scores: Scores | None, base: Scores, part: int = 0) -> tuple[float, float]:
        """By how much the cost is higher than another trial's, with its standard error when presses are redrawn."""
        if scores is None:
            return float("inf"), 0.0
        groups, redrawn = self.parts[part], self.redrawn[part]
        error = float((redrawn.costs(scores) - redrawn.costs(base)).std())
        return cost(scores, groups) - cost(base, groups), error

    def _mapped(self, jobs: list[_Job]) -> Iterator[Scores | None]:
        return self._pool.imap(_measure, jobs) if self._pool else map(_measure, jobs)


def _measure(job: _Job) -> Scores | None:
    part, trial, base = job
    try:
        return measure(_shared[part], trial, base)
    except (ValueError, IndexError, ArithmeticError, cv2.error):  # such as a quantile above 1, a window of no pixel
        return None
