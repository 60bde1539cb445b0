"""The PLC of the fault matrix: the line's program on the wire, and a note of everything that the wire showed."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Literal, NamedTuple

from plc_interface.plc_simulator.program import LineProgram, Outputs, Passage, Stage, Values
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.registers.alarms import active_alarms
from plc_interface.registers.map import BY_NAME
from station.inspection.alarm_table import ALARMS, AlarmId

_SCAN_S = 0.02
_RESET_SEQUENCES = 1000
_NO_RECIPE = 999
_NO_SEQUENCE = 2**32 - 1


class Shown(NamedTuple):
    """A result as the PLC could read it."""

    trigger_id: int
    outcome: str
    reasons: tuple[str, ...]
    area_valid: bool


class Wire:
    """Scans for ever; one fruit is inspected for each `trigger`.

    Args:
        scanner: the connection.
        take_away: empties the nest.
    """

    def __init__(self, scanner: Scanner, take_away: Callable[[], Awaitable[object]]) -> None:
        self._scanner, self._take_away = scanner, take_away
        self._program = LineProgram(lot="FAULTS")
        self._fruit = self._resetting = self._stopping = False
        self._resets = 0
        self._inputs: Values | None = None
        self._disturbed: Literal["lost", "nonsense"] | None = None
        self.accepted: list[int] = []
        """Every trigger id that the station accepted, in order."""
        self.shown: dict[int, set[Shown]] = {}
        """Every result that could be read, by its sequence; one result is one entry."""
        self.passages: list[Passage] = []
        self.lost_s = 0.0
        """Monotonic time at which the PLC last missed the station."""
        self.alarms: set[AlarmId] = set()
        """Since the last `forget_alarms`."""

    @property
    def ready(self) -> bool:
        """True while a trigger would be accepted and nothing is open."""
        return self._program.free and self._now("trigger_ready")

    @property
    def doubled(self) -> int:
        """Results that came again after their acknowledgement."""
        return self._program.counters.doubled

    @property
    def stale(self) -> int:
        """Results of a fruit that was no longer waited for."""
        return self._program.counters.stale

    @property
    def losses(self) -> int:
        """Times that the PLC missed the station."""
        return self._program.counters.losses

    @property
    def result_valid(self) -> bool:
        """True while a result can be read."""
        return self._now("result_valid")

    @property
    def packml(self) -> str:
        """PackML's state; empty where the interface does not answer."""
        return "" if self._inputs is None else BY_NAME["packml_state"].codes[int(self._inputs["packml_state"])].name

    @property
    def completing(self) -> bool:
        """True while the arm still leaves the last fruit."""
        return self.packml == "completing"

    @property
    def standing(self) -> str:
        """Stage of the PLC's program and the station's status bits, in words."""
        if self._inputs is None:
            return f"PLC {self._program.stage}, the interface does not answer"
        bits = BY_NAME["status"].names(int(self._inputs["status"]))
        return f"PLC {self._program.stage}, status {', '.join(sorted(bits)) or 'none'}"

    def forget_alarms(self) -> None:
        """Begin to note alarms anew."""
        self.alarms.clear()

    def stop(self) -> None:
        """Have `run` end after its next exchange."""
        self._stopping = True

    def trigger(self) -> None:
        """Have the fruit in the nest inspected; the line has to be ready."""
        self._fruit = True

    def disturb(self, how: Literal["lost", "nonsense"] | None) -> None:
        """Have the PLC be away, or write nonsense.

        Args:
            how: None to have it be itself again.
        """
        self._disturbed = how

    async def reset(self) -> bool:
        """Give the PLC's reset command. Whether it was carried out."""
        self._resets += 1
        sequence = _RESET_SEQUENCES + self._resets
        self._resetting = True
        try:
            async with asyncio.timeout(45):
                while True:
                    inputs = self._inputs
                    if inputs is not None and inputs["command_sequence_echo"] == sequence:
                        result = BY_NAME["command_result"].codes[int(inputs["command_result"])].name
                        if result != "executing":
                            return result == "done"
                    await asyncio.sleep(_SCAN_S)
        except TimeoutError:
            return False
        finally:
            self._resetting = False

    async def run(self) -> None:
        """Scan until `stop`; no cancellation, as an exchange in flight may swallow it."""
        async with self._scanner:
            while not self._stopping:
                losses = self.losses
                outputs = self._program.scan(
                    self._inputs, time.monotonic(), fruit_in_nest=self._fruit, recipe=0, encoder=7
                )
                if self.losses > losses:
                    self.lost_s = time.monotonic()
                if self._disturbed == "lost":
                    self._scanner.cut()
                    self._inputs = None
                else:
                    self._inputs = await self._scanner.exchange(self._with_nonsense(self._with_reset(outputs)))
                if self._inputs is not None:
                    self._note(self._inputs)
                for passage in self._program.take_passages():
                    self.passages.append(passage)
                    self._fruit = False
                    await self._take_away()
                await asyncio.sleep(_SCAN_S)

    def _with_reset(self, outputs: Outputs) -> Outputs:
        if not self._resetting or self._program.stage is Stage.CLAIMING:
            return outputs
        control = BY_NAME["control"]
        bits = control.names(int(outputs["control"])) | {"execute_command"}
        return {
            **outputs,
            "control": control.flags(bits),
            "command_code": BY_NAME["command_code"].code("reset"),
            "command_argument": 0,
            "command_sequence": _RESET_SEQUENCES + self._resets,
        }

    def _with_nonsense(self, outputs: Outputs) -> Outputs:
        if self._disturbed is None:
            return outputs
        control = BY_NAME["control"]
        return {
            **outputs,
            "control": control.flags(bit.name for bit in control.bits),
            "trigger_id": 0,
            "acknowledged_sequence": _NO_SEQUENCE,
            "command_code": BY_NAME["command_code"].code("change_recipe"),
            "command_argument": _NO_RECIPE,
        }

    def _now(self, bit: str) -> bool:
        return self._inputs is not None and bit in BY_NAME["status"].names(int(self._inputs["status"]))

    def _note(self, inputs: Values) -> None:
        accepted = int(inputs["accepted_trigger_id"])
        if accepted and (not self.accepted or self.accepted[-1] != accepted):
            self.accepted.append(accepted)
        active = active_alarms(inputs)
        self.alarms |= {alarm for alarm, row in ALARMS.items() if row.number in active}
        sequence = int(inputs["result_sequence"])
        if self.result_valid and sequence and sequence == inputs["result_sequence_again"]:
            reasons = BY_NAME["result_reasons"].names(int(inputs["result_reasons"]))
            flags = BY_NAME["result_flags"].names(int(inputs["result_flags"]))
            outcome = BY_NAME["result_outcome"].codes[int(inputs["result_outcome"])].name
            shown = Shown(int(inputs["result_trigger_id"]), outcome, tuple(sorted(reasons)), "area_valid" in flags)
            self.shown.setdefault(sequence, set()).add(shown)
