"""Messages and errors of the installer."""

import sys


class Refused(Exception):  # noqa: N818 (a refusal is an answer; nothing has gone wrong)
    """An operation that is not possible; nothing was changed. The text names the remedy."""


class Failed(Exception):  # noqa: N818 (as above; the text is for a person)
    """An operation that did not complete. The text states the present state, and what to do."""


def print_progress(sentence: str) -> None:
    """Print one line about the progress."""
    sys.stdout.write(f"install: {sentence}\n")
    sys.stdout.flush()
