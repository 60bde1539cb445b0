"""Base classes of errors that a person can repair."""

from station.messages.message import Message, verbatim


class StationError(Exception):
    """A failure with a message: what is wrong, what it means, what to do; words instead are read in English everywhere.

    The command line shows the message alone and ends with exit code 1.
    """

    exit_code = 1

    def __init__(self, message: Message | str = "") -> None:
        super().__init__(str(message))
        self.message = verbatim(message) if isinstance(message, str) else message


class BadInputError(StationError):
    """Invalid input from outside: a file, an argument, a setting.

    The command line shows the message alone and ends with exit code 2.
    """

    exit_code = 2
