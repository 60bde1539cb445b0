"""A client of the register map for tests and integrators: the PLC's side of the handshake."""

import asyncio
import itertools
import time
from collections.abc import Callable
from typing import Any

from plc_interface.client.errors import (
    ClientError,
    CommandFailedError,
    DeadlineMissedError,
    NotReadyError,
    RequestRefusedError,
    TriggerRefusedError,
)
from plc_interface.client.inspection_result import InspectionResult, published_result
from plc_interface.client.register_link import RegisterLink
from plc_interface.registers.alarms import active_alarms
from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.map import BY_NAME, COUNTERS
from station.channel.line import CommandName

POLL_S = 0.01
ANSWER_DEADLINE_S = 3.0
HEARTBEAT_S = 0.2
_NOT_WRITER = 6
"""The Modbus exception for a write without the right to."""

CONTROL, STATUS = BY_NAME["control"], BY_NAME["status"]


class StationClient(RegisterLink):
    """One PLC: claims the right to write, arms, inspects one fruit at a time, sends its heartbeat.

    As a context manager it connects and checks the references; writing begins with `arm`.
    """

    _control: frozenset[str] = frozenset()
    _beating: asyncio.Task[None] | None = None

    async def close(self) -> None:
        """Stop the heartbeat and close the connection. Idempotent; the station disarms, results are kept."""
        await self._end_beating()
        await super().close()

    async def arm(self) -> None:
        """Claim the right to write, set enable anew, and start the heartbeat. Idempotent.

        The heartbeat ends with the first write of it that fails; `inspect` reports that, and `arm` starts it anew.

        Raises:
            RequestRefusedError: another client holds the right to write.
        """
        await self.write({"write_key": WRITE_KEY})
        await self._set(frozenset())
        await self._set(frozenset({"enable"}))
        if self._beating is None or self._beating.done():
            await self._end_beating()
            self._beating = asyncio.create_task(self._beat(), name="PLC's heartbeat")

    async def disarm(self) -> None:
        """Stop the heartbeat, clear enable and release the right to write. Idempotent."""
        await self._end_beating()
        try:
            await self._set(frozenset())
            await self.write({"write_key": 0})
        except RequestRefusedError as error:
            if error.code != _NOT_WRITER:  # who is not the writer is not armed either
                raise

    async def scan(self) -> dict[str, Any]:
        """Read status, result block and alarms with one request, by register names."""
        return await self.read_groups("status", "more_status")

    async def status(self) -> frozenset[str]:
        """Return the names of the status bits that are set."""
        return STATUS.names(await self.read("status"))

    async def alarms(self) -> tuple[int, ...]:
        """Return the numbers of the active alarms, ascending."""
        return active_alarms(await self.scan())

    async def pending_result(self) -> InspectionResult | None:
        """Return the result that waits for its acknowledgement, or None."""
        return published_result(await self.scan())

    async def inspect(
        self,
        trigger_id: int,
        encoder: int = 0,
        deadline_s: float = 20.0,
        *,
        fruit_length_mm: float | None = None,
        size_class: int | None = None,
    ) -> InspectionResult:
        """Inspect one fruit: trigger, wait, read the result with this id, acknowledge it. Not idempotent.

        Args:
            trigger_id: 1 to 65535, other than the last one accepted.
            encoder: the line's encoder, given back with the result.
            deadline_s: for the whole inspection. A later result waits, and has to be acknowledged by its sequence.
            fruit_length_mm: measured by a grader, sent to a tenth; None for none.
            size_class: the grader's, 1 to 65535; None for none.

        Raises:
            NotReadyError: nothing was triggered.
            TriggerRefusedError: the station refused.
            RegisterValueError: a size that its register cannot hold; nothing was triggered.
            DeadlineMissedError: no answer or no result in time.
            ClientError: the link; whether the fruit is being inspected is then unknown.
        """
        ends_s = time.monotonic() + deadline_s
        before = await self.scan()
        self._may_trigger(before, trigger_id)
        size = {"fruit_length_mm_x10": round(10 * (fruit_length_mm or 0)), "size_class": size_class or 0}
        await self.write({"encoder": encoder, **size})
        try:
            await self.write({"control": CONTROL.flags(self._control | {"trigger"}), "trigger_id": trigger_id})
            answered = await self._until(
                lambda now: "trigger_acknowledged" in STATUS.names(now["status"]),
                min(ends_s, time.monotonic() + ANSWER_DEADLINE_S),
                f"the answer to trigger {trigger_id}",
            )
        finally:
            await self._set(self._control)
        await self._until(
            lambda now: "trigger_acknowledged" not in STATUS.names(now["status"]),
            time.monotonic() + ANSWER_DEADLINE_S,
            f"the end of the answer to trigger {trigger_id}",
        )
        if answered["accepted_trigger_id"] != trigger_id:
            code = BY_NAME["last_refusal"].codes[answered["last_refusal"]]
            raise TriggerRefusedError(f"trigger {trigger_id} was refused: {code.meaning}", code.name)

        def is_mine(now: dict[str, Any]) -> bool:
            result = published_result(now)
            return result is not None and result.trigger_id == trigger_id

        taken = published_result(await self._until(is_mine, ends_s, f"the result of trigger {trigger_id}"))
        if taken is None or taken.trigger_id != trigger_id:
            raise ClientError(f"the result of trigger {trigger_id} was lost")
        await self.acknowledge(taken.sequence)
        return taken

    async def acknowledge(self, sequence: int) -> None:
        """Acknowledge the result with this sequence; returns once the station has noted it. Idempotent.

        Raises:
            NotReadyError: another result is published, or none.
            DeadlineMissedError: the station does not note it in time.
        """
        now = await self.scan()
        if now["acknowledged_sequence_echo"] >= sequence:
            return
        if now["result_sequence"] != sequence:
            raise NotReadyError(f"result {sequence} is not the one shown, which is {now['result_sequence'] or 'none'}")
        await self.write({"acknowledged_sequence": sequence})
        await self._until_raised(
            "acknowledge",
            lambda now: now["acknowledged_sequence_echo"] >= sequence,  # higher where one behind it was called off
            f"the acknowledgement of result {sequence}",
        )

    async def command(self, command: CommandName, argument: int = 0, deadline_s: float = 40.0) -> None:
        """Send a command to the station, and wait until it is done.

        Raises:
            CommandFailedError: it was not carried out.
            DeadlineMissedError: it did not end in time.
        """
        sequence = (await self.read("command_sequence_echo")) % 65_535 + 1
        code = BY_NAME["command_code"].code(command.value)
        await self.write({"command_code": code, "command_argument": argument, "command_sequence": sequence})
        ended = await self._until_raised(
            "execute_command",
            lambda now: (
                now["command_sequence_echo"] == sequence
                and bool({"command_done", "command_failed"} & STATUS.names(now["status"]))
            ),
            f"the command {command.value}",
            deadline_s,
        )
        result = BY_NAME["command_result"].codes[ended["command_result"]]
        if result.name != "done":
            raise CommandFailedError(f"{command.value} {argument} was not carried out: {result.meaning}", result.name)

    async def change_recipe(self, number: int) -> None:
        """Make the recipe with this PLC number active. Idempotent. Raises as `command`."""
        await self.command(CommandName.CHANGE_RECIPE, number)

    async def latch_lot(self, lot: str) -> None:
        """Set the lot of the inspections from here on. Idempotent.

        Args:
            lot: up to 32 printable ASCII characters.

        Raises:
            RegisterValueError: other characters, or too many.
            DeadlineMissedError: the station did not accept it in time.
        """
        await self.write({"lot": lot})
        await self._until_raised(
            "latch_lot",
            lambda now: "lot_latched" in STATUS.names(now["status"]),
            f"the lot {lot!r} to be latched",
        )

    async def counters(self) -> dict[str, int]:
        """Return the counters by register name, from one read."""
        values = await self.read_groups("counters")
        return {register.name: values[register.name] for register in COUNTERS}

    def _may_trigger(self, now: dict[str, Any], trigger_id: int) -> None:
        bits = STATUS.names(now["status"])
        if not 1 <= trigger_id <= 65_535:
            raise NotReadyError(f"{trigger_id} is no trigger id: give one from 1 to 65535")
        if now["accepted_trigger_id"] == trigger_id:
            raise NotReadyError(f"trigger id {trigger_id} is the last one accepted: give another for each fruit")
        if "result_valid" in bits:
            raise NotReadyError(
                f"result {now['result_sequence']} of trigger {now['result_trigger_id']} waits: acknowledge it first"
            )
        if self._beating is None:
            raise NotReadyError("this client is not armed: call arm() first")
        if self._beating.done():
            raise NotReadyError(
                f"the heartbeat has ended ({self._beating.exception()}), and the station disarms: call arm() again"
            )
        if "trigger_acknowledged" in bits:
            raise NotReadyError("trigger_acknowledged is still set from the trigger before: wait until it falls")

    async def _set(self, control: frozenset[str]) -> None:
        await self.write({"control": CONTROL.flags(control)})
        self._control = control

    async def _until_raised(
        self, bit: str, holds: Callable[[dict[str, Any]], bool], what: str, limit_s: float = ANSWER_DEADLINE_S
    ) -> dict[str, Any]:
        """Set one more control bit until a scan meets a condition, and return that scan."""
        await self.write({"control": CONTROL.flags(self._control | {bit})})
        try:
            return await self._until(holds, time.monotonic() + limit_s, what)
        finally:
            await self._set(self._control)

    async def _until(self, holds: Callable[[dict[str, Any]], bool], ends_s: float, what: str) -> dict[str, Any]:
        """Return the first scan that meets a condition."""
        while not holds(now := await self.scan()):
            if time.monotonic() > ends_s:
                bits = ", ".join(sorted(STATUS.names(now["status"]))) or "none"
                raise DeadlineMissedError(f"{what} did not come in time; the status bits are: {bits}")
            await asyncio.sleep(POLL_S)
        return now

    async def _end_beating(self) -> None:
        """Stop the heartbeat, if there is one, and forget why it may have ended by itself."""
        if self._beating is not None:
            self._beating.cancel()
            await asyncio.gather(self._beating, return_exceptions=True)
            self._beating = None

    async def _beat(self) -> None:
        for beat in itertools.cycle(range(1, 2**16)):
            await self.write({"plc_heartbeat": beat})
            await asyncio.sleep(HEARTBEAT_S)
