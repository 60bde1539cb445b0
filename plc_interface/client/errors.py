"""Exceptions of the register map's client. Each message states what was found and what to do."""

from station.errors import StationError


class ClientError(StationError):
    """The base of the client's errors."""


class UnreachableError(ClientError):
    """No connection, or no answer in time."""


class RequestRefusedError(ClientError):
    """The interface answered a request with a Modbus exception."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class ReferencesError(ClientError):
    """The reference registers have other values: word order, address or map differ."""


class NotReadyError(ClientError):
    """A trigger now would be refused, or its result be ambiguous; nothing was triggered."""


class TriggerRefusedError(ClientError):
    """The station refused the trigger."""

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason
        """By its name in the codes of `last_refusal`."""


class DeadlineMissedError(ClientError):
    """No answer or result in time: of a fruit nothing is known then, divert it."""


class CommandFailedError(ClientError):
    """The station did not carry out a command."""

    def __init__(self, message: str, result: str) -> None:
        super().__init__(message)
        self.result = result
        """By its name in the codes of `command_result`."""
