"""What a person at the cell asks the station, beside what the line's PLC does."""

from typing import ClassVar, Literal

from station.channel.messages import Message

RecoveryName = Literal["protective-stop", "power", "program"]


class Recover(Message):
    """Bring the arm back after a stop: a person has looked at the cell. Answered with `CommandDone`.

    It makes the arm able to move, and moves nothing; the station goes on only after a reset.
    """

    asked: ClassVar[str] = "to bring the arm back"
    what: RecoveryName
