"""The base of every settings model: strict, frozen, and explained field by field."""

from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.problems import FieldError, Path


class Settings(BaseModel):
    """A settings model that refuses unknown keys, wrong types, NaN and infinity, and never changes."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        validate_default=True,
    )

    def accepted(self, *wrong: tuple[Path, Message]) -> Self:
        """Return the model, or raise `FieldError` for the wrong values inside it."""
        if wrong:
            raise FieldError(wrong)
        return self

    def in_order(self, lower: str, upper: str, unit: str) -> Self:
        """Return the model, or raise `FieldError` where the lower of two fields is not less than the upper."""
        value, limit = getattr(self, lower), getattr(self, upper)
        expected = messages.LESS_THAN(field=upper, limit=limit, unit=unit, value=value)
        return self if value < limit else self.accepted(((lower,), expected))


def setting(
    default: Any = ...,
    *,
    title: str,
    description: str,
    unit: str | None = None,
    **bounds: Any,
) -> Any:
    """Declare a field of a settings model.

    Args:
        default: the value where the file gives none; left out, the field is required.
        title: the name shown to a person, without the unit.
        description: what the value does and where its default comes from, in one or two sentences.
        unit: the unit's symbol (`mm`, `s`, `px`, `N`), or None for a number without one, a text or a choice.
        bounds: pydantic's own constraints (`ge`, `le`, `gt`, `lt`, `min_length`, `pattern`, …).
    """
    if unit:
        bounds["json_schema_extra"] = {"unit": unit}
    return Field(default, title=title, description=description, **bounds)
