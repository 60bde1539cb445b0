"""Damage thresholds: limits of area and growth, their scaling with the fruit's size, and the guard band."""

from itertools import pairwise
from statistics import NormalDist
from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.model import Settings, setting
from station.settings.problems import Path

LARGEST_AREA_MM2 = 260.0
"""No area can be larger: the whole field, 640x480 px, at the coarsest scale published for a DIGIT, 0.0291 mm/px."""
LARGEST_GROWTH_MM2_PER_MM = 500.0
"""No limit of the growth may be larger. An estimate."""
LARGEST_EXPONENT = 3.0
"""No exponent of the area in the fruit's length may be larger. An estimate."""


class AreaThreshold(Settings):
    """The contact area above which a fruit is damaged, at one closing."""

    closing_mm: float = setting(
        title="Closing", description="It has to be one of the result closings.", unit="mm", gt=0.0, le=50.0
    )
    area_mm2: float = setting(
        title="Area",
        description="A larger area fails the fruit. With `damage.size`: of a fruit of the reference size.",
        unit="mm²",
        gt=0.0,
        le=LARGEST_AREA_MM2,
    )
    least_area_mm2: float = setting(
        0.0,
        title="Least area",
        description="A smaller area is no fruit's: not all of the contact was seen, and the fruit is not judged. With "
        "`damage.size`: of a fruit of the reference size.",
        unit="mm²",
        ge=0.0,
        le=LARGEST_AREA_MM2,
    )

    @model_validator(mode="after")
    def _leaves_room(self) -> Self:
        return self.in_order("least_area_mm2", "area_mm2", " mm²")


class LengthRange(Settings):
    """Lengths of fruit for a recipe or a size class."""

    smallest_mm: float = setting(title="Smallest", description="No fruit is shorter.", unit="mm", ge=1.0, le=200.0)
    largest_mm: float = setting(title="Largest", description="No fruit is longer.", unit="mm", ge=1.0, le=200.0)

    @property
    def middle_mm(self) -> float:
        """Middle between smallest and largest, mm."""
        return (self.smallest_mm + self.largest_mm) / 2

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        return self.in_order("smallest_mm", "largest_mm", " mm")


class RatioRange(Settings):
    """Ratio of a fruit's length to its width."""

    smallest: float = setting(title="Smallest", description="No fruit is shorter for its width.", gt=0.0, le=10.0)
    largest: float = setting(title="Largest", description="No fruit is longer for its width.", gt=0.0, le=10.0)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        return self.in_order("smallest", "largest", "")


class SizeClass(LengthRange):
    """One of the grader's size classes."""

    number: int = setting(
        title="Number", description="The class's number, as the line's PLC writes it; 0 is none.", ge=1, le=65_534
    )


class SizeOfFruit(Settings):
    """Scaling of the area and growth limits with the fruit's size, measured by an upstream grader."""

    model_config = ConfigDict(serialize_by_alias=True)

    judged_by: Literal["length", "class"] = setting(
        alias="from",
        title="Judged by",
        description="`length` takes the length that the PLC writes, `class` the middle of the size class.",
    )
    reference_mm: float = setting(
        title="Reference length",
        description="The length for which the limits are written.",
        unit="mm",
        ge=1.0,
        le=200.0,
    )
    exponent: float = setting(
        title="Exponent",
        description="The area of a sound fruit goes as its length over the reference length to this power.",
        gt=0.0,
        le=LARGEST_EXPONENT,
    )
    expected_length: LengthRange = setting(
        title="Expected length", description="A length outside is not believed: no result."
    )
    expected_ratio: RatioRange | None = setting(
        None,
        title="Expected length over width",
        description="Permitted ratio of the length to the width at first contact. Outside it the length is taken for "
        "another fruit's: no result. Null: not checked.",
    )
    uncertainty_mm: float = setting(
        title="Uncertainty of the length",
        description="Standard uncertainty of the length given; ±1 mm without more knowledge is 0.58 mm.",
        unit="mm",
        ge=0.0,
        le=50.0,
    )
    classes: tuple[SizeClass, ...] = setting(
        (),
        title="Size classes",
        description="The grader's classes, in ascending order. Where there are none, a class is not used.",
        max_length=50,
    )
    without_size: Literal["no_result", "plain_limit"] = setting(
        "no_result",
        title="Without a size",
        description="Where the PLC writes no size: `no_result`, or `plain_limit`, which takes a fruit of the reference "
        "length with `spread` as the uncertainty of its length. An impossible size is always no result.",
    )
    spread: float = setting(
        title="Spread of the lengths",
        description="Relative standard deviation of the length among the line's fruit.",
        gt=0.0,
        le=1.0,
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        wrong: list[tuple[Path, Message]] = []
        expected = self.expected_length
        span = {"smallest_mm": expected.smallest_mm, "largest_mm": expected.largest_mm}
        if not expected.smallest_mm <= self.reference_mm <= expected.largest_mm:
            wrong.append((("reference_mm",), messages.LENGTH_UNEXPECTED(**span, value=self.reference_mm)))
        if self.judged_by == "class" and not self.classes:
            wrong.append((("classes",), messages.CLASSES_MISSING()))
        for index, each in enumerate(self.classes):
            if not expected.smallest_mm <= each.middle_mm <= expected.largest_mm:
                middle = messages.MIDDLE_UNEXPECTED(**span, value=each.middle_mm)
                wrong.append((("classes", index, "smallest_mm"), middle))
        for index, (before, after) in enumerate(pairwise(self.classes), start=1):
            if after.number <= before.number:
                rising = messages.CLASS_NOT_RISING(before=before.number, value=after.number)
                wrong.append((("classes", index, "number"), rising))
        return self.accepted(*wrong)


class Repeatability(Settings):
    """Repeatability of the area on one fruit, at one closing."""

    closing_mm: float = setting(
        title="Closing",
        description="Where it was measured; between two it is interpolated, beyond them the nearest applies.",
        unit="mm",
        gt=0.0,
        le=50.0,
    )
    relative: float = setting(
        title="Repeatability",
        description="Standard deviation of the measured over the true area, over fruit as the line has them.",
        ge=0.0,
        le=1.0,
    )


class AreaUncertainty(Settings):
    """Uncertainty for the guard band of the thresholds, in addition to that of the press itself."""

    coverage: float = setting(
        0.95,
        title="Coverage",
        description="One-sided probability that a fruit at its limit does not get PASS, and the same for FAIL; 0.95 is "
        "a coverage factor of 1.64.",
        ge=0.5,
        le=0.9999,
    )
    repeatability: tuple[Repeatability, ...] = setting(
        (Repeatability(closing_mm=3.0, relative=0.05),),
        title="Repeatability",
        description="Of the area, in ascending order of closing.",
        min_length=1,
        max_length=20,
    )

    @property
    def factor(self) -> float:
        """Coverage factor k: the guard band is k standard uncertainties."""
        return NormalDist().inv_cdf(self.coverage)

    def repeatability_at(self, closing_mm: float) -> float:
        """Repeatability at a closing, as a share: interpolated, and beyond the ends as at the nearest."""
        before = [each for each in self.repeatability if each.closing_mm <= closing_mm]
        after = [each for each in self.repeatability if each.closing_mm >= closing_mm]
        if not before or not after:
            return (before[-1:] or after[:1])[0].relative
        low, high = before[-1], after[0]
        if low is high:
            return low.relative
        share = (closing_mm - low.closing_mm) / (high.closing_mm - low.closing_mm)
        return low.relative + share * (high.relative - low.relative)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        wrong: list[tuple[Path, Message]] = []
        for index, (before, after) in enumerate(pairwise(self.repeatability), start=1):
            if after.closing_mm <= before.closing_mm:
                expected = messages.CLOSING_NOT_RISING(value=after.closing_mm)
                wrong.append((("repeatability", index, "closing_mm"), expected))
        return self.accepted(*wrong)


AREA_UNCERTAINTY = AreaUncertainty()
"""Of a recipe that says none, as those written before there was one."""


class DamageThresholds(Settings):
    """Limits of a fruit."""

    area: tuple[AreaThreshold, ...] = setting(
        title="Area thresholds",
        description="Largest areas of a good fruit, in ascending order of closing.",
        min_length=1,
        max_length=20,
    )
    # Left out of a recipe's values where every limit decides, as in recipes written before it.
    decided_by: Annotated[
        Literal["every_limit", "first_trusted", "every_trusted"], Field(exclude_if=lambda by: by == "every_limit")
    ] = setting(
        default="every_limit",
        title="Decided by",
        description="`every_limit` checks each area threshold. `every_trusted` checks each whose area is trusted, "
        "and needs at least one. Where the last threshold's area is not trusted because the contact may be larger than "
        "was seen, the earlier thresholds decide, if the area is large enough for a fruit and the image is sound. "
        "`first_trusted` takes the first whose area is trusted; later ones are for fruit whose area is not.",
    )
    growth_mm2_per_mm: float = setting(
        title="Growth threshold",
        description="A larger growth of the area per millimetre of closing fails the fruit. With `damage.size`: of a "
        "fruit of the reference size.",
        unit="mm²/mm",
        gt=0.0,
        le=LARGEST_GROWTH_MM2_PER_MM,
    )
    # The two below are left out of a recipe's values where they are as in recipes written before them: such a
    # recipe retains its content hash, and with it its approval.
    size: Annotated[SizeOfFruit | None, Field(exclude_if=lambda size: size is None)] = setting(
        None,
        title="Size of the fruit",
        description="Dependence of the limits on the fruit's length; null where the size is not used.",
    )
    uncertainty: Annotated[AreaUncertainty, Field(exclude_if=lambda given: given == AREA_UNCERTAINTY)] = setting(
        AREA_UNCERTAINTY, title="Uncertainty", description="What the guard band of the thresholds is made of."
    )

    @property
    def deciding_closing_mm(self) -> float:
        """The closing of the first limit that decides by itself on a fruit whose areas are trusted, mm."""
        return self.area[-1 if self.decided_by == "every_limit" else 0].closing_mm

    @property
    def passing_closing_mm(self) -> float:
        """The closing of the last limit that a fruit whose areas are trusted has to keep, mm."""
        return self.area[0 if self.decided_by == "first_trusted" else -1].closing_mm

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        wrong: list[tuple[Path, Message]] = []
        for index, (before, after) in enumerate(pairwise(self.area), start=1):
            if after.closing_mm <= before.closing_mm:
                expected = messages.THRESHOLD_CLOSING_NOT_RISING(value=after.closing_mm)
                wrong.append((("area", index, "closing_mm"), expected))
            if after.area_mm2 < before.area_mm2:
                wrong.append((("area", index, "area_mm2"), messages.THRESHOLD_FALLING(value=after.area_mm2)))
        return self.accepted(*wrong, *self._kept_by_no_area())

    def _kept_by_no_area(self) -> list[tuple[Path, Message]]:
        """Find limits that no area meets with its guard band on either side, if no fruit would pass for that reason.

        The guard band is that of the repeatability alone, which every press has. Its other components, and a fruit's
        size, are the press's. A fruit whose area is too small at one limit is not trusted there, and left to the others
        unless every limit decides: by `every_trusted` it has to meet the last, by `first_trusted` any.
        """
        wrong: list[tuple[Path, Message]] = []
        for index, limit in enumerate(self.area):
            if self.decided_by == "every_trusted" and limit is not self.area[-1]:
                continue
            guard = self.uncertainty.factor * self.uncertainty.repeatability_at(limit.closing_mm)
            if limit.least_area_mm2 * (1 + guard) > limit.area_mm2 * (1 - guard):
                expected = messages.KEPT_BY_NO_AREA(
                    limit_mm2=limit.area_mm2, guard_percent=100 * guard, value=limit.least_area_mm2
                )
                wrong.append((("area", index, "least_area_mm2"), expected))
        return [] if self.decided_by == "first_trusted" and len(wrong) < len(self.area) else wrong
