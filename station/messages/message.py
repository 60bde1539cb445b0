"""Message of the station: an id with typed parameters; the sentence is made where it is read."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from string import Formatter
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError


class Message(BaseModel):
    """An id and its parameters; made by calling a `Definition`. As text it is its English sentence."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    id: str = Field(min_length=1)
    parameters: dict[str, "int | float | str | Message | tuple[Message, ...]"] = Field(default_factory=dict)

    def __str__(self) -> str:
        return ENGLISH.sentence(self)

    def ids(self) -> Iterator[str]:
        """Yield the id, and the ids of the messages that it encloses."""
        yield self.id
        for value in self.parameters.values():
            for each in value if isinstance(value, tuple) else (value,):
                if isinstance(each, Message):
                    yield from each.ids()

    def __hash__(self) -> int:
        return hash((self.id, tuple(self.parameters.items())))


@dataclass(frozen=True, slots=True)
class Number:
    """A number, with so many digits behind the decimal sign; None for as few as it has, six figures at most."""

    digits: int | None = None


@dataclass(frozen=True, slots=True)
class Name:
    """A text that is the same in every language: a name, an address, a path, a library's text."""


@dataclass(frozen=True, slots=True)
class Nested:
    """Another message."""


@dataclass(frozen=True, slots=True)
class Listed:
    """Several messages, one after the other, with a separator between two."""

    separator: str = ", "


Kind = Number | Name | Nested | Listed
_ACCEPTED: dict[type[Any], type[Any] | tuple[type[Any], ...]] = {
    Number: (int, float),
    Name: str,
    Nested: Message,
    Listed: tuple,
}


@dataclass(frozen=True, slots=True)
class Definition:
    """One message that the station can give. Call it with its parameters to get a `Message`."""

    id: str
    """Area and content, as `gripper.too_hot`; also the context of its translations."""
    english: str
    """The sentence, with each parameter in braces. Where it depends on a number, the form for one."""
    parameters: Mapping[str, Kind]
    plural: str = ""
    """The form for other numbers than one; empty where there is one form."""
    counted: str = ""
    """The parameter that decides between the two."""

    def __call__(self, **parameters: Any) -> Message:
        """Make the message.

        Args:
            parameters: one for each of the definition's; a sequence of messages for one that is listed.

        Raises:
            TypeError: a parameter is missing, unknown or of another type.
        """
        if parameters.keys() != self.parameters.keys():
            raise TypeError(
                f"{self.id} takes {', '.join(self.parameters) or 'no parameters'}, got {sorted(parameters)}"
            )
        values = {name: tuple(value) if isinstance(value, list) else value for name, value in parameters.items()}
        for name, value in values.items():
            kind = type(self.parameters[name])
            if not isinstance(value, _ACCEPTED[kind]) or isinstance(value, bool):
                raise TypeError(f"{self.id}: {name} is a {kind.__name__.lower()}, got {value!r}")
        return Message(id=self.id, parameters=values)


_DEFINITIONS: dict[str, Definition] = {}
_IS_NUMBER = re.compile(r"_(mm|mm2|mm_s|s|ms|min|h|days|px|bytes|mb|kib|hz|n|count|counts|levels)$|^number$")
"""The names of parameters that are a `Number()` where their kind is left out: they carry a unit, see docs/units.md."""


def define(id: str, english: str, **parameters: Kind) -> Definition:  # noqa: A002 (the field's word, and positional)
    """Define a message of a unique id; Babel finds the call and takes id and sentence from it.

    Args:
        english: the sentence, each parameter in braces.
        parameters: what kind each of them is; one that is left out is a `Number()` if its name carries a unit, else a
            `Name`.

    Raises:
        ValueError: the id is taken, or a parameter is in no braces.
    """
    return _registered(Definition(id, english, _with_names(parameters, english)))


def define_plural(id: str, english: str, plural: str, counted: str, **parameters: Kind) -> Definition:  # noqa: A002
    """Define a message whose form depends on a number, else as `define`.

    Args:
        english: the sentence for one.
        plural: the sentence for all other numbers.
        counted: the parameter that decides.

    Raises:
        TypeError: what decides is no number among the parameters.
        ValueError: the id is taken, or a parameter is in no braces.
    """
    all_of_them = _with_names({counted: Number(), **parameters}, english)
    if not isinstance(all_of_them[counted], Number):
        raise TypeError(f"{id}: {counted} is no number among its parameters")
    if missing := (all_of_them.keys() - {counted}) ^ (fields(plural) - {counted}):
        raise ValueError(f"{id}: the two forms differ in {sorted(missing)}")
    return _registered(Definition(id, english, all_of_them, plural, counted))


def _with_names(parameters: Mapping[str, Kind], english: str) -> Mapping[str, Kind]:
    return {name: Number() if _IS_NUMBER.search(name) else Name() for name in fields(english)} | dict(parameters)


def fields(sentence: str) -> set[str]:
    """Return the names in a sentence's braces.

    Raises:
        ValueError: the braces do not pair.
    """
    return {name for _, name, _, _ in Formatter().parse(sentence) if name is not None}


def definition(id: str) -> Definition | None:  # noqa: A002
    """Find a definition; None of an id that this version does not have, as of a record that a later one wrote."""
    return _DEFINITIONS.get(id)


def definitions() -> Iterator[Definition]:
    """Yield all definitions, in the order of their ids."""
    yield from (_DEFINITIONS[each] for each in sorted(_DEFINITIONS))


def _registered(new: Definition) -> Definition:
    if new.id in _DEFINITIONS:
        raise ValueError(f"{new.id} is defined twice")
    if unused := new.parameters.keys() - fields(new.english) - {new.counted}:
        raise ValueError(f"{new.id}: the sentence has no {sorted(unused)}")
    _DEFINITIONS[new.id] = new
    return new


@dataclass(frozen=True, slots=True)
class Renderer:
    """A reader's language: how definitions and numbers are written in it."""

    form: Callable[[Definition, float], str]
    """The sentence of a definition for a count; the count is 1 where it has one form."""
    number: Callable[[float, int | None], str]
    """A number with so many digits behind the decimal sign, None for as few as it has."""

    def sentence(self, message: Message) -> str:
        """Write a message as a sentence; one of an unknown id as that id with its parameters."""
        known = definition(message.id)
        if known is None or message.parameters.keys() != known.parameters.keys():
            return f"{message.id} {' '.join(f'{name}={value}' for name, value in message.parameters.items())}".strip()
        count = message.parameters.get(known.counted, 1)
        form = self.form(known, count if isinstance(count, int | float) else 1)
        return form.format(
            **{name: self._written(value, known.parameters[name]) for name, value in message.parameters.items()}
        )

    def _written(self, value: object, kind: Kind) -> str:
        if isinstance(value, Message):
            return self.sentence(value)
        if isinstance(value, tuple) and isinstance(kind, Listed):
            return kind.separator.join(self.sentence(each) for each in value)
        if isinstance(value, int | float):
            return self.number(value, kind.digits if isinstance(kind, Number) else None)
        return str(value)


def _english_number(value: float, digits: int | None) -> str:
    if digits is not None:
        return f"{value:.{digits}f}"
    return str(value) if isinstance(value, int) else f"{value:g}"


ENGLISH = Renderer(lambda known, count: known.plural if known.plural and count != 1 else known.english, _english_number)
"""For logs and the command line."""

VERBATIM = define("text.verbatim", "{text}")
"""A text that is not the station's: a library's, the operating system's, a person's; or of records before messages."""


def verbatim(text: str) -> Message:
    """Make a message of a text that is not the station's own: it is shown as it is in every language."""
    return VERBATIM(text=text)


def message_of(error: BaseException) -> Message:
    """Return an error's message; its text as a verbatim message where it has none."""
    message = getattr(error, "message", None)
    return message if isinstance(message, Message) else verbatim(str(error) or type(error).__name__)


def message_in(text: str) -> Message | None:
    """Read a message that a text field holds as JSON, empty for none; a text from before messages as it is."""
    try:
        return Message.model_validate_json(text) if text else None
    except ValidationError:
        return verbatim(text)


def text_of(message: Message | None) -> str:
    """Write a message as JSON for a text field; None as an empty text."""
    return "" if message is None else message.model_dump_json()


def joined(messages: Sequence[Message]) -> Message:
    """Make one message of one or more sentences; one alone is returned as it is."""
    return messages[0] if len(messages) == 1 else SENTENCES(sentences=tuple(messages))


SENTENCES = define("text.sentences", "{sentences}", sentences=Listed(" "))
