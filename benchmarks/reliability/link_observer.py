"""Observer beside the line's PLC: reads the interface by a connection of its own, which nothing disturbs."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

from plc_interface.client.errors import ClientError
from plc_interface.client.register_link import RegisterLink
from plc_interface.registers.codec import WordOrder
from plc_interface.registers.map import BY_NAME
from station.inspection.alarm_table import ALARMS, AlarmId
from station.settings.modbus import ModbusSettings

_EVERY_S = 0.015
_AGAIN_S = 0.1
_STATION_LOST = 1000
"""The error code of the interface that has lost the station."""
STATISTICS = {AlarmId.MANY_NO_RESULT, AlarmId.REJECT_RATE, AlarmId.CONNECTION_FLOOD, AlarmId.PROCESS_RESTARTS}
"""Alarms about many fruits or many connections: they come with so many disturbances, and go with time."""
HELD = {"held", "aborted", "stopped"}
"""PackML's states that the station waits in, with nothing moving."""


class Observer:
    """Reads for ever, and notes the first time of every sign of a fault.

    Args:
        modbus: the interface's own address.
        idle: whether no trigger is under way, by whom gives the triggers.
    """

    def __init__(self, modbus: ModbusSettings, idle: Callable[[], bool]) -> None:
        self._modbus, self._idle = modbus, idle
        self._known: set[AlarmId] = set()
        self.alarms: set[AlarmId] = set()
        """Active now."""
        self.seen: set[AlarmId] = set()
        """Active at some time since the last `forget`."""
        self.signs: dict[str, float] = {}
        """Monotonic time of each sign's first sight since the last `forget`."""
        self.packml = ""
        self.turns = 0
        """How often PackML's state has changed."""
        self.ready = self.result_valid = False
        self._changes: list[tuple[float, bool]] = []
        self.accepted: list[int] = []
        """Every trigger id that the interface showed as accepted, in order."""
        self.shown: dict[int, set[tuple[Any, ...]]] = {}
        """Every result that could be read, by its sequence: trigger id, outcome, reasons, area."""

    @property
    def needs_person(self) -> bool:
        """True while only a person can make the station go on."""
        held_fruit = self.packml == "held" and AlarmId.FRUIT_HELD in self.alarms
        return held_fruit or self.packml in {"aborted", "stopped"}

    def forget(self) -> None:
        """Begin to note signs anew."""
        self.signs.clear()
        self.seen.clear()
        self._changes = [(time.monotonic(), self.ready)]
        self._known = set(self.alarms)

    def fell_s(self, since_s: float) -> float | None:
        """Return when a trigger would have been accepted no more.

        Args:
            since_s: monotonic; returned where it was so already.

        Returns:
            None where it was accepted for all the time.
        """
        before = [ready for at_s, ready in self._changes if at_s <= since_s]
        if before and not before[-1]:
            return since_s
        return next((at_s for at_s, ready in self._changes if at_s > since_s and not ready), None)

    async def run(self) -> None:
        """Read until cancelled."""
        modbus = self._modbus
        while True:
            link = RegisterLink(modbus.host, modbus.port, unit=modbus.unit, order=WordOrder(modbus.word_order))
            try:
                async with link:
                    while True:
                        self._note(await link.read_groups("status", "more_status"), time.monotonic())
                        await asyncio.sleep(_EVERY_S)
            except ClientError:
                self.signs.setdefault("no answer", time.monotonic())
                await asyncio.sleep(_AGAIN_S)

    def _note(self, values: dict[str, Any], now_s: float) -> None:
        status = BY_NAME["status"].names(values["status"])
        packml = BY_NAME["packml_state"].codes[values["packml_state"]].name
        self.turns += packml != self.packml
        self.packml = packml
        ready = "trigger_ready" in status
        if ready != self.ready:
            self._changes.append((now_s, ready))
            if not ready and self._idle():
                self.signs.setdefault("not ready", now_s)
        self.ready, self.result_valid = ready, "result_valid" in status
        self.alarms = {alarm for alarm, row in ALARMS.items() if self._bit(values, row.number)}
        self.seen |= self.alarms
        for alarm in self.alarms - self._known - STATISTICS:
            self.signs.setdefault(f"alarm {alarm}", now_s)
        self._known &= self.alarms
        if not {"online", "writer_owned"} <= status:
            self.signs.setdefault("PLC lost" if "online" in status else "offline", now_s)
        if values["error_code"] == _STATION_LOST:
            self.signs.setdefault("station lost", now_s)
        if self.packml in HELD | {"aborting", "stopping", "holding"}:
            self.signs.setdefault(self.packml, now_s)
        accepted = values["accepted_trigger_id"]
        if accepted and (not self.accepted or self.accepted[-1] != accepted):
            self.accepted.append(accepted)
        if self.result_valid:
            outcome = BY_NAME["result_outcome"].codes[values["result_outcome"]].name
            if outcome == "NO_RESULT":
                self.signs.setdefault("NO_RESULT", now_s)
            reasons = tuple(sorted(BY_NAME["result_reasons"].names(values["result_reasons"])))
            shown = (values["result_trigger_id"], outcome, reasons, values["result_area_mm2"])
            self.shown.setdefault(values["result_sequence"], set()).add(shown)

    @staticmethod
    def _bit(values: dict[str, Any], number: int) -> bool:
        name, bit = ("alarms", number - 1) if number <= 32 else ("alarms_33_to_64", number - 33)
        return bool(values[name] >> bit & 1)
