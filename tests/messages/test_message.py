"""Messages: made with typed parameters, carried as data, written as a sentence by who reads them."""

import pytest

from station.errors import StationError
from station.messages.message import (
    ENGLISH,
    Listed,
    Message,
    Name,
    Nested,
    Number,
    define,
    define_plural,
    definition,
    definitions,
    message_in,
    message_of,
    text_of,
    verbatim,
)

WIDE = define("test.wide", "{what} is {width_mm} mm wide", width_mm=Number(1))
SEVERAL = define_plural("test.several", "{number} fruit", "{number} fruits", "number", number=Number())
ENCLOSING = define("test.enclosing", "{first}; also {others}.", first=Nested(), others=Listed(" and "))


def test_a_message_is_its_english_sentence_as_text() -> None:
    assert str(WIDE(what="the berry", width_mm=12.345)) == "the berry is 12.3 mm wide"


def test_a_message_encloses_others() -> None:
    message = ENCLOSING(first=WIDE(what="it", width_mm=1), others=[SEVERAL(number=1), SEVERAL(number=2)])
    assert str(message) == "it is 1.0 mm wide; also 1 fruit and 2 fruits."


def test_a_message_survives_json() -> None:
    message = ENCLOSING(first=WIDE(what="it", width_mm=1), others=[SEVERAL(number=1), SEVERAL(number=2)])
    assert Message.model_validate_json(message.model_dump_json()) == message


@pytest.mark.parametrize(
    "parameters",
    [{}, {"what": "it"}, {"what": "it", "width_mm": "1"}, {"what": 1, "width_mm": 1}, {"what": "it", "width_mm": True}],
)
def test_wrong_parameters_are_refused(parameters: dict[str, object]) -> None:
    with pytest.raises(TypeError, match=r"test\.wide"):
        WIDE(**parameters)


def test_an_id_of_a_later_version_is_shown_with_its_parameters() -> None:
    assert str(Message(id="later.thing", parameters={"width_mm": 3})) == "later.thing width_mm=3"


def test_a_message_of_another_version_with_other_parameters_is_shown_all_the_same() -> None:
    assert str(Message(id="test.wide", parameters={"height_mm": 3})) == "test.wide height_mm=3"


def test_an_id_is_defined_once_and_its_braces_are_its_parameters() -> None:
    with pytest.raises(ValueError, match="twice"):
        define("test.wide", "again")
    with pytest.raises(ValueError, match=r"the sentence has no \['height_mm'\]"):
        define("test.braces", "{width_mm}", width_mm=Number(), height_mm=Number())
    with pytest.raises(ValueError, match=r"differ in \['what'\]"):
        define_plural("test.forms", "{n} {what}", "{n} fruit", "n", n=Number())
    with pytest.raises(TypeError, match="no number"):
        define_plural("test.plural", "{what}", "{what}s", "what", what=Name())
    assert definition("test.braces") is None


def test_a_parameter_whose_kind_is_left_out_is_a_name():
    with pytest.raises(TypeError, match="what is a name"):
        WIDE(what=2, width_mm=1)


def test_an_error_carries_its_message() -> None:
    message = WIDE(what="it", width_mm=1)
    assert message_of(StationError(message)) == message
    assert str(StationError(message)) == "it is 1.0 mm wide"
    assert message_of(OSError(2, "no such file")) == verbatim("[Errno 2] no such file")


def test_a_text_field_holds_a_message_or_the_words_of_before() -> None:
    message = WIDE(what="it", width_mm=1)
    assert message_in(text_of(message)) == message
    assert message_in("2 GB left") == verbatim("2 GB left")
    assert (message_in(""), text_of(None)) == (None, "")


def test_a_message_gives_its_ids_and_those_that_it_encloses() -> None:
    message = ENCLOSING(first=WIDE(what="it", width_mm=1), others=[SEVERAL(number=1)])
    assert list(message.ids()) == ["test.enclosing", "test.wide", "test.several"]


def test_every_definition_can_be_written() -> None:
    for each in definitions():
        values = {name: _example(kind) for name, kind in each.parameters.items()}
        assert "{" not in ENGLISH.sentence(each(**values)), each.id


def _example(kind: object) -> object:
    if isinstance(kind, Nested):
        return verbatim("words")
    if isinstance(kind, Listed):
        return [verbatim("one"), verbatim("two")]
    return 2 if isinstance(kind, Number) else "name"
