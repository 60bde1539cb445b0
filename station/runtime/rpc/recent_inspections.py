"""Recent inspections for the run page: their curves, and a picture of each, made at the first request."""

import asyncio
import base64
import logging
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from station.channel.line import Outcome
from station.channel.panel_run import Counts, CurvePointSummary, Fruit, FruitSummary, LimitView, Picture
from station.devices.camera.interface import Image
from station.errors import StationError
from station.messages import jobs as messages
from station.press.rig import MeasuredStep
from station.records.errors import RecordsError
from station.records.judgement import limit_factor
from station.records.model import InspectionRecord
from station.runtime.cycle.inspection import Inspection
from station.settings.recipe_model import Recipe
from station.vision.contact import Mask

MOST_IN_FULL = 24
MOST_IN_SHORT = 200
_JPEG_QUALITY = 82
_CORNER_PX = 1.0
"""Greatest distance of the outline's corners from the contact's edge."""
_RETRY_S = 10.0

log = logging.getLogger(__name__)


class NotRecentError(StationError):
    """The fruit is not among the recent ones any more."""


ReadStep = Callable[[], tuple[Image, Mask]]
"""Returns a step's image and the contact in it; blocks if they have to be read from the disk."""
ReadCounts = Callable[[str, int], Mapping[str, int]]
"""Returns the records' counts of a lot's outcomes, of its fruit below a sequence; blocks."""


@dataclass(slots=True)
class RecentFruit:
    """A fruit with its picture, or what it is made of."""

    fruit: Fruit
    look: ReadStep | None
    """None if no image was stored, or once the picture is made."""
    picture: Picture | None = None
    """None before the first request."""


class RecentInspections:
    """Recent inspections in memory, and counts of the lots last inspected or shown; the records have all of them."""

    def __init__(self, read_counts: ReadCounts) -> None:
        self._read_counts = read_counts
        self._by_sequence: OrderedDict[int, RecentFruit] = OrderedDict()
        self._short: deque[FruitSummary] = deque(maxlen=MOST_IN_SHORT)
        self._lots: OrderedDict[str, Counter[str]] = OrderedDict()
        """In the order of their last use."""
        self._reading: set[asyncio.Task[None]] = set()
        self._turn = asyncio.Lock()
        self.changes = 0
        """Counts up with each new fruit and each other outcome."""

    @property
    def last_sequence(self) -> int | None:
        """Return the sequence of the last fruit with an outcome."""
        return self._short[-1].sequence if self._short else None

    def restore(
        self, short: Iterable[FruitSummary], full: Iterable[RecentFruit], lots: Mapping[str, Mapping[str, int]]
    ) -> None:
        """Restore the recent inspections of the previous start, oldest first, and each lot's count of outcomes."""
        self._short.extend(short)
        self._by_sequence.update((each.fruit.short.sequence, each) for each in full)
        self._lots.update((name, Counter(counts)) for name, counts in lots.items())

    async def close(self) -> None:
        """Cancel what is still being read."""
        for task in self._reading:
            task.cancel()
        await asyncio.gather(*self._reading, return_exceptions=True)

    def add(self, now: Inspection) -> None:
        """Add an inspection with its durable outcome, or that which the PLC was given before it was durable."""
        if now.standing is None:
            return
        fruit, look = _new_fruit(now, now.published or now.standing)
        self._by_sequence[fruit.short.sequence] = RecentFruit(fruit, look)
        while len(self._by_sequence) > MOST_IN_FULL:
            self._by_sequence.popitem(last=False)
        self._short.append(fruit.short)
        self.changes += 1
        self._counted(fruit.short.lot, fruit.short.sequence)[fruit.short.outcome] += 1

    def set_outcome(self, outcome: Outcome) -> None:
        """Set the outcome that was published to the PLC; it overrides the station's own result."""
        entry = self._by_sequence.get(outcome.sequence)
        if entry is None or entry.fruit.short.outcome == outcome.outcome:
            return
        before = entry.fruit.short
        now = before.model_copy(update={"outcome": outcome.outcome, "reasons": tuple(map(str, outcome.reasons))})
        entry.fruit = entry.fruit.model_copy(update={"short": now})
        self.changes += 1
        self._short = deque((now if each.sequence == now.sequence else each for each in self._short), MOST_IN_SHORT)
        if (counted := self._lots.get(before.lot)) is not None:
            counted.subtract([before.outcome])
            counted.update([now.outcome])

    def counts(self, lot: str) -> Counts:
        """Count a lot's outcomes; of fruit without a lot, those since this start of the station.

        Earlier fruit of a lot that is not in memory are counted as soon as the records are read.
        """
        last = self.last_sequence
        counted = Counter[str]() if last is None else self._counted(lot, last + 1)
        return Counts(passed=counted["PASS"], failed=counted["FAIL"], unjudged=counted["NO_RESULT"])

    def _counted(self, lot: str, below: int) -> Counter[str]:
        """Return a lot's counts; of one that is not in memory, its fruit below a sequence are read in a thread."""
        counted = self._lots.get(lot)
        if counted is None:
            counted = self._lots[lot] = Counter()
            if lot:
                task = asyncio.create_task(self._read_earlier(lot, below, counted), name=f"counts of lot {lot}")
                self._reading.add(task)
                task.add_done_callback(self._reading.discard)
        self._lots.move_to_end(lot)
        while len(self._lots) > MOST_IN_FULL:
            self._lots.popitem(last=False)
        return counted

    async def _read_earlier(self, lot: str, below: int, counted: Counter[str]) -> None:
        """Add the counts of a lot's earlier fruit, which do not change any more; later fruit are counted meanwhile."""
        while self._lots.get(lot) is counted:
            try:
                counted.update(await asyncio.to_thread(self._read_counts, lot, below))
            except RecordsError as error:
                log.warning("lot %s is shown without its earlier fruit: %s", lot, error)
                await asyncio.sleep(_RETRY_S)
            else:
                return

    def recent(self, most: int) -> tuple[FruitSummary, ...]:
        """Return the last fruit, newest first."""
        return tuple(reversed(self._short))[:most]

    def fruit(self, sequence: int) -> Fruit:
        """Return one of the recent fruit.

        Raises:
            NotRecentError: it is not among them.
        """
        return self._find(sequence).fruit

    async def picture(self, sequence: int) -> Picture:
        """Return a fruit's picture, made in a thread at the first request.

        Raises:
            NotRecentError: it is not among them, or has no image.
        """
        entry = self._find(sequence)
        async with self._turn:
            if entry.picture is None and entry.look is not None:
                entry.picture, entry.look = await asyncio.to_thread(_picture, entry.look), None
        if entry.picture is None:
            raise NotRecentError(messages.NO_PICTURE(sequence=sequence))
        return entry.picture

    def _find(self, sequence: int) -> RecentFruit:
        entry = self._by_sequence.get(sequence)
        if entry is None:
            raise NotRecentError(messages.NOT_RECENT(sequence=sequence, number=MOST_IN_FULL))
        return entry


def fruit_view(
    published: Outcome, record: InspectionRecord, recipe: Recipe, revision: str, deadline_s: float, picture: int | None
) -> Fruit:
    """Make the page's view of a fruit from the station's own result, and the step that has a picture."""
    onset_mm = record.measures.get("onset_mm")
    points = [point for point in record.curve if point.closing_mm is not None and point.closing_mm >= 0]
    factor = limit_factor(record.measures)
    return Fruit(
        short=short_view(published, recipe.name, [point.area_mm2 for point in points]),
        explanation=record.explanation,
        recipe_title=recipe.title,
        revision=revision,
        onset_mm=onset_mm if isinstance(onset_mm, float) else None,
        curve=tuple(
            CurvePointSummary(
                closing_mm=round(point.closing_mm or 0.0, 3),
                area_mm2=round(point.area_mm2 or 0.0, 2),
                flagged=bool(point.flags),
            )
            for point in points
        ),
        limits=tuple(
            LimitView(
                closing_mm=each.closing_mm,
                area_mm2=factor * each.area_mm2,
                least_area_mm2=factor * each.least_area_mm2,
            )
            for each in recipe.damage.area
        ),
        growth_mm2_per_mm=factor * recipe.damage.growth_mm2_per_mm,
        deadline_s=deadline_s,
        phases_s=dict(record.phases_s),
        picture_step=picture,
    )


def short_view(published: Outcome, recipe: str, areas_mm2: Iterable[float | None]) -> FruitSummary:
    """Make the view of a fruit in a list, by its recipe's name and the areas of the steps since the contact onset."""
    return FruitSummary(
        sequence=published.sequence,
        outcome=published.outcome,
        reasons=tuple(map(str, published.reasons)),
        ended_utc_ms=published.ended_utc_ms,
        duration_ms=published.duration_ms,
        recipe=recipe,
        lot=published.lot,
        area_mm2=published.area_mm2,
        closing_mm=published.closing_mm,
        areas_mm2=tuple(round(area_mm2 or 0.0, 2) for area_mm2 in areas_mm2),
    )


def _new_fruit(now: Inspection, published: Outcome) -> tuple[Fruit, ReadStep | None]:
    """Make the view of a new fruit, with the picture of its deciding step."""
    # An outcome of the PLC interface's own has the PLC's lot, which is none where a person named it at the panel.
    published = published.model_copy(update={"lot": now.trigger.lot})
    record, revision = now.record(), now.active.snapshot.revision
    step = deciding_step(record)
    look = None if step is None else _step_reader(now.seen[step])
    return fruit_view(published, record, now.active.recipe, revision, now.limits.inspection_s, step), look


def deciding_step(record: InspectionRecord) -> int | None:
    """Return the step whose picture shows most: the one that decided, else the last; None if there is no step."""
    decided_mm = record.closing_mm
    for point in record.curve:
        if decided_mm is not None and point.closing_mm is not None and abs(point.closing_mm - decided_mm) < 1e-6:
            return point.step
    return record.curve[-1].step if record.curve else None


def _step_reader(seen: MeasuredStep) -> ReadStep:
    image, mask = seen.image, seen.contact.mask
    return lambda: (image, mask)


def _picture(look: ReadStep) -> Picture:
    image, mask = look()
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not done:
        raise NotRecentError(messages.PICTURE_NOT_ENCODED())
    outlines, _ = cv2.findContours(np.ascontiguousarray(mask), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    outline: tuple[tuple[int, int], ...] = ()
    if outlines:
        corners = cv2.approxPolyDP(max(outlines, key=cv2.contourArea), _CORNER_PX, closed=True)
        outline = tuple((int(x), int(y)) for x, y in corners[:, 0, :])
    height_px, width_px = image.shape[:2]
    return Picture(
        jpeg=base64.b64encode(data.tobytes()).decode(), width_px=width_px, height_px=height_px, outline=outline
    )
