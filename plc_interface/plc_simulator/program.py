"""The PLC's program, scan by scan: the handshake as docs/plc describes it for an integrator.

Pure: a scan's inputs and the time go in, the outputs come out, and each fruit's passage is recorded when it is decided.
"""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from plc_interface.plc_simulator.faults import FaultPlan, LineFault
from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.codec import WordOrder, decode, encode, is_invalid
from plc_interface.registers.map import BY_NAME

Values = Mapping[str, int | float | str]
"""Registers by name."""
Outputs = dict[str, int | str]
"""The control block's registers by name."""

HEARTBEAT_LIMIT_S = 2.0
"""A station whose heartbeat stops for longer is lost."""
ANSWER_LIMIT_S = 10.0
"""A trigger or command that is answered later is given up."""
RESULT_MARGIN_S = 2.0
"""Added to the station's own deadline for a result."""
_LONGEST_RESULT_S = 120.0
"""Deadline for a result where the station gives none. An estimate."""
_FAULT_S = 1.5
"""Duration of an injected late acknowledgement, or of swapped words. An estimate."""
_FROZEN_S = 3.0
"""Duration of an injected frozen heartbeat: longer than the default of `handshake.plc_heartbeat_timeout_s`."""
_TRIGGER_IDS = 65_535
_SKIPPED_IDS = 3


class Stage(StrEnum):
    """Stage of the program."""

    CLAIMING = "claiming"
    """Not armed: the right to write is claimed, and results of an earlier run are acknowledged."""
    WAITING_FOR_FRUIT = "waiting for fruit"
    CHANGING_RECIPE = "changing the recipe"
    TRIGGERING = "triggering"
    """The trigger is up and not yet answered."""
    WAITING_FOR_RESULT = "waiting for result"
    ACKNOWLEDGING = "acknowledging"


class Decision(StrEnum):
    """The line's decision on a fruit."""

    PASS = "PASS"  # noqa: S105 (no password)
    FAIL = "FAIL"
    NO_RESULT = "NO_RESULT"
    REFUSED = "refused"
    """The station did not accept the trigger."""
    NO_ANSWER = "no answer"
    """Neither a refusal nor a result came in time."""


@dataclass(frozen=True, slots=True)
class Passage:
    """One fruit's passage through the station, as the PLC records it."""

    number: int
    trigger_id: int
    decision: Decision
    reasons: tuple[str, ...]
    sequence: int
    """0 where there is no result."""
    area_mm2: float | None
    closing_mm: float | None
    cycle_s: float
    """From the trigger to what decided."""
    fruit_length_mm_x10: int
    """The size that the result was found with, as it says itself; 0 for none."""
    fault: LineFault | None
    """The PLC's own injected fault, if any."""

    @property
    def diverted(self) -> bool:
        """True for every decision but PASS."""
        return self.decision is not Decision.PASS


@dataclass(slots=True)
class Counters:
    """The PLC's counters, for comparison with the station's own."""

    stale: int = 0
    """Results whose fruit is not the one in the nest: taken away, never used."""
    doubled: int = 0
    """Results under a sequence that was taken before."""
    losses: int = 0
    """Times that the station was lost."""


@dataclass(slots=True)
class _Fruit:
    number: int
    trigger_id: int
    since_s: float
    fault: LineFault | None
    accepted: bool = False
    deadline_s: float = 0.0
    played: bool = False
    left_s: float = 0.0


class LineProgram:
    """A PLC's program for one station; a lot of at most 32 ASCII characters is latched before the first fruit."""

    def __init__(self, plan: FaultPlan | None = None, lot: str = "") -> None:
        self.stage = Stage.CLAIMING
        self._lot, self._lot_wanted = lot, False
        self._ready = self._jaws_open = self._arm_left = self._inhibited = False
        self._recipe = self._command_sequence = 0
        self.counters = Counters()
        self._plan = plan or FaultPlan()
        self._fruit: _Fruit | None = None
        self._fruits = 0
        self._trigger_id = 0
        self._taken = self._closed = 0
        self._heartbeat = 0
        self._station_heartbeat: int | float | str | None = None
        self._heard_s: float | None = None
        self._since_s = 0.0
        self._acknowledge = False
        self._playing_after: LineFault | None = None
        self._passages: list[Passage] = []
        self.cut_wanted = False
        """Whether the connection is to be cut now, as an injected fault; reading it does not clear it."""

    @property
    def free(self) -> bool:
        """True if the next fruit may enter the nest: the one before is decided, and the jaws are open."""
        return self.stage is Stage.WAITING_FOR_FRUIT and self._fruit is None and self._jaws_open

    @property
    def may_move(self) -> bool:
        """True if the fruit in the nest may be moved: it is decided, and the station reports that its arm has left."""
        return self._fruit is None and self._arm_left

    def take_passages(self) -> list[Passage]:
        """Return the fruits decided since the last call."""
        passages, self._passages = self._passages, []
        return passages

    def scan(
        self,
        inputs: Values | None,
        now_s: float,
        *,
        fruit_in_nest: bool,
        recipe: int = 0,
        encoder: int = 0,
        fruit_length_mm_x10: int = 0,
    ) -> Outputs:
        """Run one scan.

        Args:
            inputs: status and result block as read in the scan before; None if the read failed.
            now_s: monotonic.
            fruit_in_nest: a fruit is in the nest and not decided yet.
            recipe: the number of the fruit's recipe; 0 to take the active one.
            encoder: the line's count.
            fruit_length_mm_x10: of the fruit in the nest, as a grader upstream measured it; 0 where none did.

        Returns:
            The control block to write.
        """
        self.cut_wanted = self._ready = self._jaws_open = self._arm_left = False
        if inputs is None or not self._alive(inputs, now_s):
            self._lose(now_s)
        else:
            self._step(inputs, now_s, recipe if fruit_in_nest else None)
        return self._outputs(now_s, encoder, fruit_length_mm_x10)

    def _alive(self, inputs: Values, now_s: float) -> bool:
        if inputs["station_heartbeat"] != self._station_heartbeat or self._heard_s is None:
            self._station_heartbeat, self._heard_s = inputs["station_heartbeat"], now_s
        return now_s - self._heard_s < HEARTBEAT_LIMIT_S

    def _lose(self, now_s: float) -> None:
        if self.stage is not Stage.CLAIMING:
            self.counters.losses += 1
            self.stage, self._acknowledge = Stage.CLAIMING, False
        self._give_up_in_time(now_s)

    def _step(self, inputs: Values, now_s: float, recipe: int | None) -> None:
        status = BY_NAME["status"].names(int(inputs["status"]))
        self._inhibited = "enable_inhibited" in BY_NAME["more_status"].names(int(inputs["more_status"]))
        self._ready = "trigger_ready" in status
        never_gripped = "online" in status and not inputs["active_recipe"]  # without its station it is 0 too
        self._jaws_open = self._ready or never_gripped
        self._arm_left = "acquiring" not in status or never_gripped
        if not {"writer_owned", "online"} <= status and self.stage is not Stage.CLAIMING:
            self._lose(now_s)
            return
        if self.stage is Stage.CLAIMING:
            self._claim(inputs, status, now_s)
        elif self.stage is Stage.WAITING_FOR_FRUIT:
            self._await_fruit(inputs, status, now_s, recipe)
        elif self.stage is Stage.CHANGING_RECIPE:
            self._await_recipe(inputs, now_s)
        elif self.stage is Stage.TRIGGERING:
            self._await_answer(inputs, status, now_s)
        elif self.stage is Stage.WAITING_FOR_RESULT:
            self._await_result(inputs, status, now_s)
        else:
            self._await_acknowledged(inputs, now_s)
        self._give_up_in_time(now_s)

    def _claim(self, inputs: Values, status: frozenset[str], now_s: float) -> None:
        if not {"writer_owned", "online"} <= status:
            return
        latched = inputs["latched_lot_checksum"] == zlib.crc32(self._lot.encode("ascii"))
        self._lot_wanted = bool(self._lot) and not latched
        if self._lot_wanted:
            return
        if not self._trigger_id:
            self._trigger_id = int(inputs["accepted_trigger_id"])
            self._command_sequence = int(inputs["command_sequence_echo"])
        fruit = self._fruit
        if fruit is not None and not fruit.accepted and int(inputs["accepted_trigger_id"]) == fruit.trigger_id:
            self._accept(fruit, inputs, now_s)
        self._go(Stage.WAITING_FOR_RESULT if fruit is not None and fruit.accepted else Stage.WAITING_FOR_FRUIT, now_s)

    def _await_fruit(self, inputs: Values, status: frozenset[str], now_s: float, recipe: int | None) -> None:
        if "result_valid" in status:
            self._take(inputs, now_s)
            return
        if self._fruit is None and recipe is not None:
            self._fruits += 1
            fault = self._plan.of_fruit(self._fruits)
            self._fruit = _Fruit(self._fruits, self._next_id(fault), now_s, fault)
        if self._fruit is None or not {"command_done", "command_failed", "trigger_acknowledged"}.isdisjoint(status):
            return
        self._fruit.since_s = now_s
        if recipe and recipe != inputs["active_recipe"]:
            self._recipe, self._command_sequence = recipe, self._command_sequence % 65_535 + 1
            self._go(Stage.CHANGING_RECIPE, now_s)
        elif self._ready:
            self._playing_after = None
            self._go(Stage.TRIGGERING, now_s)

    def _await_recipe(self, inputs: Values, now_s: float) -> None:
        if inputs["command_sequence_echo"] != self._command_sequence:
            return
        result = BY_NAME["command_result"].codes[int(inputs["command_result"])].name
        if result == "executing" or (result == "done" and inputs["active_recipe"] != self._recipe):
            return
        if result != "done":
            self._decide(Decision.REFUSED, now_s, reasons=(f"recipe change: {result}",))
        self._go(Stage.WAITING_FOR_FRUIT, now_s)

    def _next_id(self, fault: LineFault | None) -> int:
        if fault is LineFault.REPEATED_ID and self._trigger_id:
            return self._trigger_id
        self._trigger_id += _SKIPPED_IDS if fault is LineFault.SKIPPED_ID else 1
        self._trigger_id = (self._trigger_id - 1) % _TRIGGER_IDS + 1
        return self._trigger_id

    def _await_answer(self, inputs: Values, status: frozenset[str], now_s: float) -> None:
        fruit = self._fruit
        if fruit is None or "trigger_acknowledged" not in status:
            return
        if "missed" in status and int(inputs["last_refused_trigger_id"]) == fruit.trigger_id:
            reason = BY_NAME["last_refusal"].codes[int(inputs["last_refusal"])].name
            self._decide(Decision.REFUSED, now_s, reasons=(reason,))
            self._go(Stage.WAITING_FOR_FRUIT, now_s)
        elif int(inputs["accepted_trigger_id"]) == fruit.trigger_id:
            self._accept(fruit, inputs, now_s)
            self._go(Stage.WAITING_FOR_RESULT, now_s)

    def _accept(self, fruit: _Fruit, inputs: Values, now_s: float) -> None:
        fruit.accepted = True
        limit_s = int(inputs["result_deadline_ms"]) / 1000 or _LONGEST_RESULT_S
        fruit.deadline_s = now_s + limit_s + RESULT_MARGIN_S

    def _await_result(self, inputs: Values, status: frozenset[str], now_s: float) -> None:
        fruit = self._fruit
        if fruit is not None and fruit.fault is LineFault.RECONNECT and not fruit.played:
            fruit.played = self.cut_wanted = True
        elif fruit is not None and self._frozen(now_s):
            return
        elif fruit is not None and fruit.fault is LineFault.FROZEN_HEARTBEAT and not fruit.played:
            fruit.played = True
            self._lose(now_s)
        elif "result_valid" in status and not self._leaves_waiting(inputs, now_s):
            self._take(inputs, now_s)

    def _frozen(self, now_s: float) -> bool:
        fruit = self._fruit
        waits = fruit is not None and fruit.fault is LineFault.FROZEN_HEARTBEAT and not fruit.played
        return waits and self.stage is Stage.WAITING_FOR_RESULT and now_s - self._since_s < _FROZEN_S

    def _leaves_waiting(self, inputs: Values, now_s: float) -> bool:
        """Inject the late acknowledgement, after the fruit's own result was first read."""
        fruit = self._fruit
        if fruit is None or fruit.fault is not LineFault.LATE_ACKNOWLEDGE or not self._shows(inputs, fruit):
            return False
        if not fruit.played:
            fruit.played, fruit.left_s = True, now_s
        return now_s - fruit.left_s < _FAULT_S

    @staticmethod
    def _shows(inputs: Values, fruit: _Fruit | None) -> bool:
        return fruit is not None and int(inputs["result_trigger_id"]) == fruit.trigger_id

    def _take(self, inputs: Values, now_s: float) -> None:
        """Use the result if it is the fruit's own, and acknowledge it in any case."""
        sequence = int(inputs["result_sequence"])
        if not sequence or not sequence == inputs["result_sequence_again"] == inputs["result_sequence_end"]:
            return
        fruit = self._fruit
        if sequence == self._closed:
            self.counters.doubled += 1
        elif sequence == self._taken:
            pass  # taken before the station was lost, which has not seen the acknowledgement
        elif fruit is not None and fruit.accepted and self._shows(inputs, fruit):
            names = BY_NAME["result_reasons"].names(int(inputs["result_reasons"]))
            outcome = BY_NAME["result_outcome"].codes[int(inputs["result_outcome"])].name
            self._decide(Decision(outcome), now_s, reasons=tuple(sorted(names)), inputs=inputs)
        else:
            self.counters.stale += 1
        self._taken, self._acknowledge = sequence, True
        self._go(Stage.ACKNOWLEDGING, now_s)

    def _await_acknowledged(self, inputs: Values, now_s: float) -> None:
        if int(inputs["acknowledged_sequence_echo"]) >= self._taken:  # higher where one behind it was called off
            self._acknowledge, self._closed = False, self._taken
            waits = self._fruit is not None and self._fruit.accepted
            self._go(Stage.WAITING_FOR_RESULT if waits else Stage.WAITING_FOR_FRUIT, now_s)

    def _give_up_in_time(self, now_s: float) -> None:
        fruit = self._fruit
        if fruit is None:
            return
        limit_s = fruit.deadline_s if fruit.accepted else fruit.since_s + ANSWER_LIMIT_S
        waits = fruit.accepted or self.stage in {Stage.TRIGGERING, Stage.CLAIMING, Stage.CHANGING_RECIPE}
        if waits and now_s > limit_s:
            self._decide(Decision.NO_ANSWER, now_s)
            if self.stage is not Stage.CLAIMING:
                self._go(Stage.WAITING_FOR_FRUIT, now_s)

    def _decide(
        self, decision: Decision, now_s: float, reasons: tuple[str, ...] = (), inputs: Values | None = None
    ) -> None:
        fruit, self._fruit = self._fruit, None
        if fruit is None:
            return
        self._playing_after = fruit.fault
        area = _valid(inputs, "result_area_mm2")
        closing = _valid(inputs, "result_closing_mm_x100")
        self._passages.append(
            Passage(
                number=fruit.number,
                trigger_id=fruit.trigger_id,
                decision=decision,
                reasons=reasons,
                sequence=int(inputs["result_sequence"]) if inputs else 0,
                area_mm2=area,
                closing_mm=None if closing is None else closing / 100,
                cycle_s=now_s - fruit.since_s,
                fruit_length_mm_x10=int(inputs["result_fruit_length_mm_x10"]) if inputs else 0,
                fault=fruit.fault,
            )
        )

    def _go(self, stage: Stage, now_s: float) -> None:
        self.stage, self._since_s = stage, now_s

    def _outputs(self, now_s: float, encoder: int, fruit_length_mm_x10: int) -> Outputs:
        if not self._frozen(now_s):
            self._heartbeat = (self._heartbeat + 1) % 2**16
        fruit, armed = self._fruit, self.stage is not Stage.CLAIMING
        forgotten = fruit is not None and fruit.fault is LineFault.FORGOTTEN_TRIGGER
        left_up = self._playing_after is LineFault.FORGOTTEN_ACKNOWLEDGE
        bits = {
            "enable": armed and not self._inhibited,
            "buffer_results": armed,
            "trigger": self.stage is Stage.TRIGGERING or (forgotten and self.stage is Stage.WAITING_FOR_RESULT),
            "acknowledge": self._acknowledge or (left_up and armed),
            "latch_lot": self._lot_wanted,
            "execute_command": self.stage is Stage.CHANGING_RECIPE,
        }
        return {
            "control": BY_NAME["control"].flags(name for name, up in bits.items() if up),
            "trigger_id": fruit.trigger_id if fruit else self._trigger_id,
            "acknowledged_sequence": self._acknowledged_sequence(now_s),
            "command_code": BY_NAME["command_code"].code("change_recipe"),
            "command_argument": self._recipe,
            "command_sequence": self._command_sequence,
            "plc_heartbeat": self._heartbeat,
            "encoder": encoder,
            "lot": self._lot,
            "write_key": WRITE_KEY,
            "fruit_length_mm_x10": fruit_length_mm_x10 if self.stage is Stage.TRIGGERING else 0,
            "size_class": 0,
        }

    def _acknowledged_sequence(self, now_s: float) -> int:
        swaps = self._playing_after is LineFault.SWAPPED_WORDS and self.stage is Stage.ACKNOWLEDGING
        if not swaps or now_s - self._since_s >= _FAULT_S:
            return self._taken
        register = BY_NAME["acknowledged_sequence"]
        return int(decode(register, encode(register, self._taken, WordOrder.LOW_FIRST), WordOrder.HIGH_FIRST))


def _valid(inputs: Values | None, name: str) -> float | None:
    """Return a value of the result; None if the register reports none."""
    if inputs is None or is_invalid(BY_NAME[name], inputs[name]):
        return None
    return float(inputs[name])
