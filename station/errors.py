"""What every room raises when something is wrong in a way that a person can mend."""


class StationError(Exception):
    """A failure with a message that names the place, what was expected and what to do.

    The command line shows the message alone and ends with exit code 1.
    """

    exit_code = 1


class BadInputError(StationError):
    """Something from outside (a file, an argument, a setting) is not what it has to be.

    The command line shows the message alone and ends with exit code 2.
    """

    exit_code = 2
