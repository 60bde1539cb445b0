"""A recipe's limits for one fruit's size: what the grader's length or class makes of them, or why it cannot be used."""

from dataclasses import dataclass
from math import hypot, sqrt

from station.inspection.fruit_size import FruitSize
from station.inspection.press import Press
from station.messages import judge as messages
from station.messages.message import Message
from station.settings.damage import SizeClass, SizeOfFruit
from station.settings.recipe_model import Recipe

_CONTRADICTION = 2.0
"""A length so many of its standard uncertainties outside its class contradicts it: of true ones, about 1 in 20 does."""


@dataclass(frozen=True, slots=True)
class SizedLimits:
    """A recipe whose limits are those of one fruit."""

    recipe: Recipe
    """With area limits, growth limits and early stop for this fruit; as written where the size does not count."""
    factor: float = 1.0
    """By which they differ from those for a fruit of the reference size."""
    length_mm: float | None = None
    """The length that the limits are for; None where it does not count or is not known."""
    relative_uncertainty: float = 0.0
    """Standard uncertainty of the limits, from the length's, as a share."""
    without_size: bool = False
    """The recipe uses the size, the PLC gave none, and the recipe lets the limits as written be used."""
    problem: Message | None = None
    """Why the limits for this fruit are not known; None where they are."""


def sized_limits(press: Press, recipe: Recipe) -> SizedLimits:
    """The limits for the fruit of a press.

    Only a size that is missing may be replaced by the recipe's fallback. One that cannot be is a fault of the line or
    another fruit's, and then nothing that is known of this fruit's size is true.
    """
    rule, size = recipe.damage.size, press.size
    if rule is None:
        return SizedLimits(recipe)
    if problem := _problem(size, rule, recipe.title) or _another_fruits(size, rule, press.onset_mm):
        return SizedLimits(recipe, problem=problem)
    length = _length(size, rule)
    if length is not None:
        length_mm, uncertainty_mm = length
        factor = (length_mm / rule.reference_mm) ** rule.exponent
        # The limit is a power of the length, so its relative uncertainty is the length's times the exponent.
        return SizedLimits(_scaled(recipe, factor), factor, length_mm, rule.exponent * uncertainty_mm / length_mm)
    if rule.without_size == "plain_limit":
        return SizedLimits(recipe, relative_uncertainty=rule.exponent * rule.spread, without_size=True)
    if rule.judged_by == "length":
        return SizedLimits(recipe, problem=messages.NO_LENGTH())
    return SizedLimits(recipe, problem=messages.NO_CLASS())


def _length(size: FruitSize, rule: SizeOfFruit) -> tuple[float, float] | None:
    """The length to judge by and its standard uncertainty, mm; None where the PLC did not give it."""
    if rule.judged_by == "length":
        return None if size.length_mm is None else (size.length_mm, rule.uncertainty_mm)
    known = _class(size, rule)
    if known is None:
        return None
    # Anywhere in the class alike (a rectangular distribution), and the grader sorts by an uncertain length.
    width_mm = known.largest_mm - known.smallest_mm
    return known.middle_mm, hypot(width_mm / sqrt(12), rule.uncertainty_mm)


def _class(size: FruitSize, rule: SizeOfFruit) -> SizeClass | None:
    return next((each for each in rule.classes if each.number == size.size_class), None)


def _problem(size: FruitSize, rule: SizeOfFruit, title: str) -> Message | None:
    """Return the reason why a given size is impossible; None if it is possible or missing."""
    expected, length_mm, known = rule.expected_length, size.length_mm, _class(size, rule)
    if length_mm is not None and not expected.smallest_mm <= length_mm <= expected.largest_mm:
        return messages.LENGTH_UNEXPECTED(
            length_mm=length_mm, recipe=title, smallest_mm=expected.smallest_mm, largest_mm=expected.largest_mm
        )
    if size.size_class is None or not rule.classes:
        return None
    if known is None:
        return messages.CLASS_UNLISTED(number=size.size_class)
    room_mm = _CONTRADICTION * rule.uncertainty_mm
    if length_mm is not None and not known.smallest_mm - room_mm <= length_mm <= known.largest_mm + room_mm:
        return messages.SIZE_CONTRADICTS(
            length_mm=length_mm, number=known.number, smallest_mm=known.smallest_mm, largest_mm=known.largest_mm
        )
    return None


def _another_fruits(size: FruitSize, rule: SizeOfFruit, width_mm: float | None) -> Message | None:
    """Return the reason why a size does not fit the measured width; None if it fits or is unknown.

    A line whose sizes have slipped by one fruit writes lengths that are all possible by themselves.
    """
    ratio, known = rule.expected_ratio, _class(size, rule)
    if ratio is None or width_mm is None:
        return None
    if size.length_mm is not None:
        shortest_mm = longest_mm = size.length_mm
        problem = messages.LENGTH_OF_ANOTHER(length_mm=size.length_mm, width_mm=width_mm)
    elif known is not None:
        shortest_mm, longest_mm = known.smallest_mm, known.largest_mm
        problem = messages.CLASS_OF_ANOTHER(number=known.number, width_mm=width_mm)
    else:
        return None
    fits = longest_mm >= ratio.smallest * width_mm and shortest_mm <= ratio.largest * width_mm
    return None if fits else problem


def _scaled(recipe: Recipe, factor: float) -> Recipe:
    """The recipe with every limit on area or growth times a factor: at one closing the growth goes with the area."""
    damage, stop = recipe.damage, recipe.early_stop
    area = tuple(
        each.model_copy(update={"area_mm2": factor * each.area_mm2, "least_area_mm2": factor * each.least_area_mm2})
        for each in damage.area
    )
    growth = {"growth_mm2_per_mm": factor * damage.growth_mm2_per_mm}
    limits = {"area_mm2": factor * stop.area_mm2, "growth_mm2_per_mm": factor * stop.growth_mm2_per_mm}
    return recipe.model_copy(
        update={
            "damage": damage.model_copy(update={"area": area, **growth}),
            "early_stop": stop.model_copy(update=limits),
        }
    )
