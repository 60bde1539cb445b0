"""The last fruit as the panel shows them: their curves, and a picture of each, made when somebody asks for it."""

import asyncio
import base64
from collections import Counter, OrderedDict, deque
from dataclasses import dataclass

import cv2
import numpy as np

from station.channel.line import Outcome
from station.channel.panel_live import Counts, CurveShown, Fruit, FruitShort, LimitShown, Picture
from station.devices.camera.interface import Image
from station.errors import StationError
from station.service.eye import Seen
from station.service.inspection import Inspection
from station.vision.contact import Mask

MOST_IN_FULL = 24
MOST_IN_SHORT = 200
_JPEG_QUALITY = 82
_CORNER_PX = 1.0
"""The outline's corners lie as close to the contact's edge."""


class ForgottenError(StationError):
    """The fruit is not among the last any more."""


@dataclass(slots=True)
class _Kept:
    fruit: Fruit
    image: Image | None
    mask: Mask | None
    picture: Picture | None = None


class PanelMemory:
    """The fruit since this start of the station; all that was ever inspected is in the records."""

    def __init__(self) -> None:
        self._kept: OrderedDict[int, _Kept] = OrderedDict()
        self._short: deque[FruitShort] = deque(maxlen=MOST_IN_SHORT)
        self._lots: OrderedDict[str, Counter[str]] = OrderedDict()
        self._turn = asyncio.Lock()

    @property
    def last_sequence(self) -> int | None:
        """Of the last fruit with an outcome."""
        return self._short[-1].sequence if self._short else None

    def ended(self, now: Inspection) -> None:
        """An inspection has its durable outcome.

        Args:
            now: with it.
        """
        if now.standing is None:
            return
        fruit, shown = _fruit(now, now.standing), _shown(now)
        self._kept[fruit.short.sequence] = _Kept(fruit, shown and shown.image, shown and shown.contact.mask)
        while len(self._kept) > MOST_IN_FULL:
            self._kept.popitem(last=False)
        self._short.append(fruit.short)
        self._lots.setdefault(fruit.short.lot, Counter())[fruit.short.outcome] += 1
        while len(self._lots) > MOST_IN_FULL:
            self._lots.popitem(last=False)

    def stands(self, outcome: Outcome) -> None:
        """The PLC was told this, which stands, also against what the station had found.

        Args:
            outcome: as told.
        """
        kept = self._kept.get(outcome.sequence)
        if kept is None or kept.fruit.short.outcome == outcome.outcome:
            return
        before = kept.fruit.short
        now = before.model_copy(update={"outcome": outcome.outcome, "reasons": tuple(map(str, outcome.reasons))})
        kept.fruit = kept.fruit.model_copy(update={"short": now})
        self._short = deque((now if each.sequence == now.sequence else each for each in self._short), MOST_IN_SHORT)
        self._lots[before.lot].subtract([before.outcome])
        self._lots[before.lot].update([now.outcome])

    def counts(self, lot: str | None) -> Counts:
        """How a lot's fruit ended, since this start of the station.

        Args:
            lot: its name; None for none.
        """
        counted = self._lots.get(lot or "", Counter())
        return Counts(passed=counted["PASS"], failed=counted["FAIL"], unjudged=counted["NO_RESULT"])

    def recent(self, most: int) -> tuple[FruitShort, ...]:
        """The last fruit, newest first.

        Args:
            most: at most so many.
        """
        return tuple(reversed(self._short))[:most]

    def fruit(self, sequence: int) -> Fruit:
        """One of the last fruit.

        Args:
            sequence: its number.

        Raises:
            ForgottenError: it is not among them.
        """
        return self._find(sequence).fruit

    async def picture(self, sequence: int) -> Picture:
        """Its picture, made in a thread at the first time.

        Args:
            sequence: its number.

        Raises:
            ForgottenError: it is not among the last, or nothing was seen of it.
        """
        kept = self._find(sequence)
        async with self._turn:
            if kept.picture is None and kept.image is not None and kept.mask is not None:
                kept.picture = await asyncio.to_thread(_picture, kept.image, kept.mask)
                kept.image = kept.mask = None
        if kept.picture is None:
            raise ForgottenError(f"no picture was taken of inspection {sequence}")
        return kept.picture

    def _find(self, sequence: int) -> _Kept:
        kept = self._kept.get(sequence)
        if kept is None:
            raise ForgottenError(f"inspection {sequence} is not among the last {MOST_IN_FULL}: look into the history")
        return kept


def _shown(now: Inspection) -> Seen | None:
    """The step whose picture says most: the one that decided, else the last."""
    deciding = now.verdict.deciding if now.verdict is not None else None
    onset_mm = now.onset_mm
    if deciding is not None and onset_mm is not None:
        for seen in now.seen:
            if abs(onset_mm - seen.step.move.width_mm - deciding.closing_mm) < 1e-6:
                return seen
    return now.seen[-1] if now.seen else None


def _fruit(now: Inspection, standing: Outcome) -> Fruit:
    recipe, record, shown = now.active.recipe, now.record(), _shown(now)
    points = [point for point in record.curve if point.closing_mm is not None and point.closing_mm >= 0]
    return Fruit(
        short=FruitShort(
            sequence=standing.sequence,
            outcome=standing.outcome,
            reasons=tuple(map(str, standing.reasons)),
            ended_utc_ms=standing.ended_utc_ms,
            duration_ms=standing.duration_ms,
            recipe=recipe.name,
            lot=standing.lot,
            area_mm2=standing.area_mm2,
            closing_mm=standing.closing_mm,
            areas_mm2=tuple(round(point.area_mm2 or 0.0, 2) for point in points),
        ),
        explanation=record.explanation,
        recipe_title=recipe.title,
        revision=now.active.snapshot.revision,
        onset_mm=now.onset_mm,
        curve=tuple(
            CurveShown(
                closing_mm=round(point.closing_mm or 0.0, 3),
                area_mm2=round(point.area_mm2 or 0.0, 2),
                flagged=bool(point.flags),
            )
            for point in points
        ),
        limits=tuple(
            LimitShown(closing_mm=each.closing_mm, area_mm2=each.area_mm2, least_area_mm2=each.least_area_mm2)
            for each in recipe.damage.area
        ),
        early_stop_mm2=recipe.early_stop.area_mm2,
        growth_mm2_per_mm=recipe.damage.growth_mm2_per_mm,
        deadline_s=now.limits.inspection_s,
        phases_s=dict(now.phases_s),
        picture_step=None if shown is None else now.seen.index(shown),
    )


def _picture(image: Image, mask: Mask) -> Picture:
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not done:
        raise ForgottenError("the picture could not be encoded")
    outlines, _ = cv2.findContours(np.ascontiguousarray(mask), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    outline: tuple[tuple[int, int], ...] = ()
    if outlines:
        corners = cv2.approxPolyDP(max(outlines, key=cv2.contourArea), _CORNER_PX, closed=True)
        outline = tuple((int(x), int(y)) for x, y in corners[:, 0, :])
    height_px, width_px = image.shape[:2]
    return Picture(
        jpeg=base64.b64encode(data.tobytes()).decode(), width_px=width_px, height_px=height_px, outline=outline
    )
