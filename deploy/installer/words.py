"""How the installer speaks, and how it refuses."""

import sys


class Refused(Exception):  # noqa: N818 (a refusal is an answer; nothing has gone wrong)
    """Something is in the way; nothing was changed. The text names the remedy."""


class Failed(Exception):  # noqa: N818 (as above; the text is for a person)
    """Something was begun and did not come to its end. The text says what stands now, and what to do."""


def say(sentence: str) -> None:
    """Tell whoever runs the installer what is done.

    Args:
        sentence: one line.
    """
    sys.stdout.write(f"install: {sentence}\n")
    sys.stdout.flush()
