"""Messages as the records store them: JSON objects; a plain sentence is one of a version before messages."""

import json
from typing import Any

from pydantic import ValidationError

from station.messages.message import Message, verbatim

JUDGEMENT, FIRST_PRESS = "judgement", "first_press_findings"
"""Messages that are stored among an inspection's measures."""


def to_stored(message: Message) -> dict[str, Any]:
    """Return a message as plain values."""
    return message.model_dump(mode="json")


def from_stored(stored: Any) -> Message:
    """Return the message of a stored value; a sentence, and what is no message, as it is.

    Args:
        stored: as JSON gave it.
    """
    if isinstance(stored, str):
        return verbatim(stored)
    text = json.dumps(stored, ensure_ascii=False)
    try:
        return Message.model_validate_json(text)
    except ValidationError:
        return verbatim(text)
