"""Recipe of one fruit: width steps, segmentation, damage thresholds."""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.damage import LARGEST_AREA_MM2, DamageThresholds
from station.settings.model import Settings, setting
from station.settings.problems import Path, WantedError
from station.settings.segmentation import Segmentation

_LIGHT_TOUCH = 0.5
"""Share of a limit's closing from which the judge takes its steps into account: `LIGHT_TOUCH` of `inspection.evidence`,
which no settings import."""
_AT_CLOSING_MM = 0.22
"""A step requested so little before a closing may be taken for one at it: the gripper goes to the nearest count, of
85 mm / 227 = 0.37 mm, and the judge takes what is 0.03 mm short for the closing, `AT_MM` of `inspection.evidence`."""


def _integer(value: object) -> object:
    """Refuse true and 1.0, which pydantic accepts for the choice 1, even if it is strict."""
    if type(value) is not int:
        raise ValueError  # the schema says what was expected
    return value


def _printable(title: str) -> str:
    if not title.isprintable():
        raise WantedError(messages.PRINTABLE())
    return title


class WidthRange(Settings):
    """Widths of fruit for this recipe."""

    smallest_mm: float = setting(
        title="Smallest", description="A narrower fruit is not this recipe's.", unit="mm", ge=1.0, le=85.0
    )
    largest_mm: float = setting(
        title="Largest", description="A wider fruit is not this recipe's.", unit="mm", ge=1.0, le=85.0
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        return self.in_order("smallest_mm", "largest_mm", " mm")


class WidthSteps(Settings):
    """Closing of the gripper and times of the images."""

    start: Literal["onset", "width"] = setting(
        title="Start",
        description="`onset` counts the steps from the measured first contact, `width` from a given gripper width.",
    )
    start_width_mm: float | None = setting(
        None,
        title="Start width",
        description="Gripper width of the first image where `start` is `width`; else null.",
        unit="mm",
        ge=0.0,
        le=85.0,
    )
    step_mm: float = setting(
        title="Step",
        description="Closing from one image to the next; a count of the gripper is about 0.4 mm.",
        unit="mm",
        ge=0.4,
        le=5.0,
    )
    number: int = setting(
        title="Number of steps",
        description="Steps after the start; an image is taken at the start and after each step.",
        ge=1,
        le=100,
    )
    result_closings_mm: tuple[Annotated[float, Field(gt=0.0, le=50.0)], ...] = setting(
        title="Results' closings",
        description="Closings from the onset at which the area is a result, in ascending order.",
        unit="mm",
        min_length=1,
        max_length=20,
    )
    closing_limit_mm: float = setting(
        title="Closing limit",
        description="No command closes the gripper further than this from the start of the steps.",
        unit="mm",
        ge=0.4,
        le=50.0,
    )
    # Left out of a recipe's values where it is false, as in recipes written before it: they keep their content hash.
    stop_when_decided: Annotated[bool, Field(exclude_if=lambda stops: not stops)] = setting(
        default=False,
        title="Stop when decided",
        description="No step is made once no further one can change the outcome. False takes the curve to the last "
        "step, for research.",
    )

    measured: Annotated[Literal["at_rest", "while_closing"], Field(exclude_if=lambda way: way == "at_rest")] = setting(
        default="at_rest",
        title="Measured",
        description="`at_rest` stops for each step. `while_closing` closes without a stop up to the last damage "
        "threshold that a fruit has to keep, and takes each image's width at its capture: a fruit takes less time.",
    )

    @property
    def travel_mm(self) -> float:
        """Closing from the start to the last image, mm."""
        return round(self.step_mm * self.number, 6)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        wrong: list[tuple[Path, Message]] = []
        if self.start == "width" and self.start_width_mm is None:
            wrong.append((("start_width_mm",), messages.WIDTH_MISSING()))
        if self.start == "onset" and self.start_width_mm is not None:
            wrong.append((("start_width_mm",), messages.WIDTH_UNUSED(value=self.start_width_mm)))
        if self.start == "width" and self.measured == "while_closing":
            wrong.append((("measured",), messages.AT_REST_ONLY()))
        if self.start_width_mm is not None and self.travel_mm > self.start_width_mm:
            wrong.append((("number",), messages.STEPS_BEYOND_WIDTH(travel_mm=self.travel_mm)))
        if self.travel_mm > self.closing_limit_mm:
            expected = messages.STEPS_BEYOND_LIMIT(limit_mm=self.closing_limit_mm, travel_mm=self.travel_mm)
            wrong.append((("number",), expected))
        for index, closing_mm in enumerate(self.result_closings_mm):
            place = ("result_closings_mm", index)
            if closing_mm > self.travel_mm:
                wrong.append((place, messages.BEYOND_STEPS(travel_mm=self.travel_mm, value=closing_mm)))
            elif index and closing_mm <= self.result_closings_mm[index - 1]:
                wrong.append((place, messages.CLOSING_NOT_RISING(value=closing_mm)))
        return self.accepted(*wrong)


class Grip(Settings):
    """Motion of the gripper during the steps."""

    speed_mm_s: float = setting(
        title="Speed",
        description="Closing speed; the 2F-85 takes 20 to 150 mm/s.",
        unit="mm/s",
        ge=20.0,
        le=150.0,
    )
    force_n: float = setting(
        title="Force limit",
        description="The gripper's own force limit, 20 to 235 N on the 2F-85. It does not protect soft fruit.",
        unit="N",
        ge=20.0,
        le=235.0,
    )


class Imaging(Settings):
    """Times and number of images."""

    settle_s: float = setting(
        title="Settle time",
        description="Wait after each step before the first frame: soft fruit creeps.",
        unit="s",
        ge=0.0,
        le=10.0,
    )
    frames_per_step: int = setting(
        title="Frames a step",
        description="Frames averaged after each step.",
        ge=1,
        le=30,
    )
    reference_frames: int = setting(
        title="Reference frames",
        description="Frames with nothing touching the gel whose median is the reference.",
        ge=1,
        le=60,
    )


class PressPlan(Settings):
    """Number of presses of one fruit, and centring of the fruit in the sensor's field by the arm."""

    centre_from_mm: float | None = setting(
        None,
        title="Centre from",
        description="Where the first contact is farther from the field's middle, the jaws open, the arm follows it "
        "within `arm.centring.most_mm`, and they close again; null for never. Without an arm nothing is done.",
        unit="mm",
        ge=0.2,
        le=5.0,
    )
    attempts: int = setting(
        1,
        title="Attempts",
        description="With 2, a fruit whose first press was inconclusive (near a limit, cut by the border,"
        " too little confidence) is let go and pressed once more, and both presses are judged"
        " together.",
        ge=1,
        le=2,
    )


PRESS_PLAN = PressPlan()
"""Of a recipe that says none, as those written before there was one."""


class EarlyStop(Settings):
    """Conditions that end the steps before the last one, to spare fruit and gel."""

    area_mm2: float = setting(
        title="Area limit",
        description="At a larger area no further step is made.",
        unit="mm²",
        gt=0.0,
        le=LARGEST_AREA_MM2,
    )
    growth_mm2_per_mm: float = setting(
        title="Growth limit",
        description="At a larger growth of the area per millimetre of closing no further step is made.",
        unit="mm²/mm",
        gt=0.0,
        le=1000.0,
    )


class Recipe(Settings):
    """One fruit's width steps, segmentation and damage thresholds."""

    schema_version: Annotated[Literal[1], BeforeValidator(_integer)] = setting(
        title="Schema version", description="Version of the schema; it rises when a field's meaning changes."
    )
    name: str = setting(
        title="Name",
        description="The recipe's name in commands and records: small letters, digits and underscores.",
        pattern=r"^[a-z][a-z0-9_]{0,31}$",
    )
    title: Annotated[str, AfterValidator(_printable)] = setting(
        title="Title",
        description="The name that operators see, one line of at most 40 characters.",
        pattern=r"^\S.{0,39}$",
    )
    plc_number: int = setting(
        title="PLC number",
        description="The number by which the line's PLC names the recipe; 0 is none.",
        ge=1,
        le=65_535,
    )
    expected_width: WidthRange = setting(
        title="Expected width", description="The widths of fruit that the recipe is meant for."
    )
    steps: WidthSteps = setting(title="Width steps", description="How the gripper closes while images are taken.")
    # Left out of a recipe's values where it is as in recipes written before it: they keep their content hash.
    press: Annotated[PressPlan, Field(exclude_if=lambda plan: plan == PRESS_PLAN)] = setting(
        PRESS_PLAN, title="Press", description="How often one fruit may be pressed, and where."
    )
    gripper: Grip = setting(title="Gripper", description="How the gripper moves during the steps.")
    imaging: Imaging = setting(title="Imaging", description="When images are taken, and how many.")
    segmentation: Segmentation = setting(
        Segmentation(), title="Segmentation", description="How the contact is found in an image."
    )
    damage: DamageThresholds = setting(title="Damage thresholds", description="What fails a fruit.")
    early_stop: EarlyStop = setting(
        title="Early stop", description="What ends the steps before the last one, to spare fruit and gel."
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        wrong: list[tuple[Path, Message]] = []
        closings = [messages.CLOSING(closing_mm=each) for each in self.steps.result_closings_mm]
        for index, threshold in enumerate(self.damage.area):
            if threshold.closing_mm not in self.steps.result_closings_mm:
                expected = messages.NO_RESULT_CLOSING(closings=closings, value=threshold.closing_mm)
                wrong.append((("damage", "area", index, "closing_mm"), expected))
        wrong += self._judged_on_one_step()
        largest_mm2 = max(threshold.area_mm2 for threshold in self.damage.area)
        if self.early_stop.area_mm2 < largest_mm2:
            expected = messages.STOP_BELOW_AREA(limit_mm2=largest_mm2, value=self.early_stop.area_mm2)
            wrong.append((("early_stop", "area_mm2"), expected))
        if self.early_stop.growth_mm2_per_mm < self.damage.growth_mm2_per_mm:
            limit, given = self.damage.growth_mm2_per_mm, self.early_stop.growth_mm2_per_mm
            wrong.append((("early_stop", "growth_mm2_per_mm"), messages.STOP_BELOW_GROWTH(limit=limit, value=given)))
        return self.accepted(*wrong)

    def _judged_on_one_step(self) -> list[tuple[Path, Message]]:
        """Find the limits that the judge would hold against one step only: it shows no onset, so no fruit would pass.

        A limit is judged by the steps from a light touch's end, a share of the first closing that is judged with it, to
        the first at its closing or beyond; so one step has to be before it. Not covered: a gripper's count may make
        the only step before it shorter than requested, and then a light touch.
        """
        wrong: list[tuple[Path, Message]] = []
        area, step_mm = self.damage.area, self.steps.step_mm
        together = self.damage.decided_by == "every_limit"
        for index, threshold in enumerate(area):
            if together and index < len(area) - 1:
                continue
            from_mm = _LIGHT_TOUCH * (area[0] if together else threshold).closing_mm
            below_mm = threshold.closing_mm - _AT_CLOSING_MM
            if not any(from_mm <= number * step_mm < below_mm for number in range(1, self.steps.number + 1)):
                expected = messages.JUDGED_ON_ONE_STEP(
                    step_mm=step_mm, from_mm=from_mm, below_mm=round(below_mm, 6), value=threshold.closing_mm
                )
                wrong.append((("damage", "area", index, "closing_mm"), expected))
        return wrong
