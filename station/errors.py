"""Base classes of errors that a person can repair."""

from typing import Self

from station.messages.message import Message, verbatim


class StationError(Exception):
    """A failure with a message: what is wrong, what it means, what to do. A text in its place is English everywhere.

    The command line shows the message alone and ends with exit code 1.
    """

    exit_code = 1

    def __init__(self, message: Message | str = "") -> None:
        super().__init__(str(message))
        self.message = verbatim(message) if isinstance(message, str) else message

    def again(self) -> Self:
        """Return this stored error without its traceback, to be raised again.

        Python adds to an error's traceback, with all that its functions held, each time it is raised: one that is
        stored while a device waits for a person would grow by megabytes an hour.
        """
        return self.with_traceback(None)


class BadInputError(StationError):
    """Invalid input from outside: a file, an argument, a setting.

    The command line shows the message alone and ends with exit code 2.
    """

    exit_code = 2
