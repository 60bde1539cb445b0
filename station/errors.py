"""Base classes of errors that a person can repair."""


class StationError(Exception):
    """A failure with a message: place, expected value, remedy.

    The command line shows the message alone and ends with exit code 1.
    """

    exit_code = 1


class BadInputError(StationError):
    """Invalid input from outside: a file, an argument, a setting.

    The command line shows the message alone and ends with exit code 2.
    """

    exit_code = 2
