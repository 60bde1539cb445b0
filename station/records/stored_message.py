"""Messages as the records store them: JSON objects; a plain sentence is one of a version before messages."""

import json
from typing import Any

from station.messages import records as messages
from station.messages.message import Message, message_in, verbatim

JUDGEMENT, FIRST_PRESS = "judgement", "first_press_findings"
"""Messages that are stored among an inspection's measures."""

_IMAGES_BEFORE_MESSAGES = {
    "kept": messages.IMAGES_KEPT(),
    "pending": messages.IMAGES_PENDING(),
    "not wanted": messages.IMAGES_NOT_WANTED(),
    "removed: space for newer ones": messages.IMAGES_REMOVED(),
    "lost: the station ended before they were written": messages.IMAGES_LOST(),
    "none: known by its outcome alone": messages.IMAGES_NONE(),
}
"""The states of an inspection's images as versions before messages stored them."""


def images_state_of(text: str) -> Message | None:
    """Return the state of an inspection's images; None of one that runs."""
    return _IMAGES_BEFORE_MESSAGES.get(text) or message_in(text)


def to_stored(message: Message) -> dict[str, Any]:
    """Return a message as plain values."""
    return message.model_dump(mode="json")


def from_stored(stored: Any) -> Message:
    """Return the message of a stored JSON value; a sentence, and what is no message, as it is."""
    if isinstance(stored, str):
        return verbatim(stored)
    return message_in(json.dumps(stored, ensure_ascii=False)) or verbatim("")
