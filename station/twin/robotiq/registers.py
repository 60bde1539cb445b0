"""The gripper's registers as its Modbus map lays them out.

Source: Robotiq 2F-85 & 2F-140 instruction manual, chapter 4 (control): robot output 0x03E8.., robot input 0x07D0...
"""

from dataclasses import dataclass

COMMAND_ADDRESS = 0x03E8
STATUS_ADDRESS = 0x07D0
REGISTERS = 8
"""Registers in each of the two blocks: bytes 0 to 15, of which bytes 6 to 15 are reserved and read 0."""


@dataclass(frozen=True, slots=True)
class Command:
    """Command of the master to the gripper, as the robot output registers carry it."""

    activate: bool = False
    go_to: bool = False
    release: bool = False
    release_opens: bool = False
    position: int = 0
    speed: int = 0
    force: int = 0

    def words(self) -> list[int]:
        """The three registers from 0x03E8 on."""
        action = self.activate | self.go_to << 3 | self.release << 4 | self.release_opens << 5
        return [action << 8, self.position, self.speed << 8 | self.force]

    @classmethod
    def from_words(cls, words: list[int]) -> "Command":
        """Decode the three registers from 0x03E8 on."""
        action = words[0] >> 8
        return cls(
            activate=bool(action & 0x01),
            go_to=bool(action & 0x08),
            release=bool(action & 0x10),
            release_opens=bool(action & 0x20),
            position=words[1] & 0xFF,
            speed=words[2] >> 8,
            force=words[2] & 0xFF,
        )


@dataclass(frozen=True, slots=True)
class Status:
    """Status of the gripper, as the robot input registers report it."""

    activate: bool
    go_to: bool
    state: int
    """gSTA: 0 reset, 1 activating, 3 active."""
    object_: int
    """gOBJ: 0 moving, 1 contact while opening, 2 contact while closing, 3 at position or object lost."""
    fault: int
    """gFLT; the controller's own kFLT is always 0."""
    echo: int
    position: int
    current: int
    """gCU, in 10 mA."""

    def words(self) -> list[int]:
        """The three registers from 0x07D0 on."""
        gripper = self.activate | self.go_to << 3 | self.state << 4 | self.object_ << 6
        return [gripper << 8, self.fault << 8 | self.echo, self.position << 8 | self.current]
