"""State of the handshake."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import inf
from typing import Any, NamedTuple

from plc_interface.handshake.actions import RequestBegin
from plc_interface.handshake.events import Inputs, Moment
from plc_interface.handshake.journal import COMMAND_RESULT, MOST_DISOWNED, Journal, Running
from plc_interface.handshake.modes import Arming, Command, Inspection, Link, Lot, Mode, Result, Service, Signal, Trigger
from plc_interface.registers.map import QUEUE_PLACES
from station.channel.line import Outcome, Refusal, StationState
from station.messages import line as messages
from station.messages.message import Message


class Fault(Enum):
    """A fault of the line, by its message; latched until clear_error."""

    PLC_SILENT = messages.PLC_SILENT
    WRITER_LOST = messages.WRITER_LOST
    TRIGGER_NOT_RESET = messages.TRIGGER_NOT_RESET
    ACKNOWLEDGE_NOT_RESET = messages.ACKNOWLEDGE_NOT_RESET
    EXECUTE_NOT_RESET = messages.EXECUTE_NOT_RESET
    LATCH_NOT_RESET = messages.LATCH_NOT_RESET
    WRONG_ACKNOWLEDGEMENT = messages.WRONG_ACKNOWLEDGEMENT
    BAD_LOT = messages.BAD_LOT
    COMMAND_BUSY = messages.COMMAND_BUSY
    COMMAND_REUSED = messages.COMMAND_REUSED

    @property
    def message(self) -> Message:
        """Return what is wrong, with the remedy."""
        return self.value()


class Size(NamedTuple):
    """The fruit's size from the PLC, by the registers' names; 0 for none."""

    fruit_length_mm_x10: int = 0
    size_class: int = 0


NO_SIZE = Size()


HANDSHAKE_COUNTERS = (
    "count_triggers",
    "count_accepted",
    "count_pass",
    "count_fail",
    "count_no_result",
    "count_missed",
    "count_late",
    "count_overrun",
    "count_communication",
)
"""Counters, by the names of the register map; all wrap round at 2³²."""


@dataclass(slots=True, kw_only=True)
class State:
    """The modes of all regions and their data. Only `machine.step` makes one from another."""

    link: Link = Link.LOST
    arming: Arming = Arming.DISARMED
    service: Service = Service.IN_SERVICE
    trigger: Trigger = Trigger.LOW
    inspection: Inspection = Inspection.NONE
    result: Result = Result.EMPTY
    command: Command = Command.IDLE
    lot: Lot = Lot.OPEN

    timers: Mapping[Signal, float] = field(default_factory=dict)
    """When each running timer is due, on the monotonic clock."""
    numbers: int = 0
    """The last number given to a request."""

    # the PLC
    writer: bool = False
    inputs: Inputs = field(default_factory=Inputs)
    seen: frozenset[str] | None = None
    """The control bits at the writer's last write; None before its first one, when every bit is news."""
    last_heartbeat: int | None = None
    """As this writer has written it; None before its first, as another's is no change by this one."""
    taken: int = 0
    """The sequence in the first write after a start: the PLC had taken it, though the journal may not have it."""
    unconfirmed: int = 0
    """The sequence taken by its number alone; the bit may still follow."""
    size: Size = NO_SIZE
    """The size written since the last trigger: a trigger uses it up, so that no fruit gets the one before's."""
    acknowledge_stuck: bool = False
    """The PLC forgot its acknowledge bit, which counts as fallen until it is."""
    last_refusal: Refusal | None = None
    last_refused_id: int = 0
    missed: bool = False
    overrun: bool = False

    # the station
    station: StationState | None = None
    """Its last answer; None while it is lost."""
    last_boot: str = ""
    station_boots: int = 0
    heartbeat: int = 0
    adopted: bool = False
    """The station has answered `Resume` at least once since this interface started."""
    open_request: int | None = None
    """The number of `RequestOpen` that is not answered."""
    last_failure: str = ""
    """Of a request, as logged; empty since the station answered `Resume`."""

    news_from_s: float = -inf
    """When a trigger was last answered, or its answer lost, on the monotonic clock: a beat that was sent before says
    nothing of what the station does since."""
    acquiring: bool = True
    """The station may be at the fruit in the nest; after a start this is unknown until a beat reports IDLE."""

    # the line
    diverts: bool = True
    """Whether the line's output can divert a fruit; if not, no inspection is started."""

    # inspections
    pending: RequestBegin | None = None
    """Of the trigger whose acceptance by the station is pending."""
    running: Running | None = None
    queue: tuple[Outcome, ...] = ()
    """Not acknowledged, in order of sequence; the first one is published."""
    published: int = 0
    """The sequence of the last published result."""
    toggle: bool = False

    # commands
    command_request: int | None = None
    command_changes_recipe: bool = False

    counters: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(HANDSHAKE_COUNTERS, 0))
    reset_utc_ms: int
    unlisted: int = 0
    """Pairs of mode and signal that came and are not in the table: refused."""
    faults: tuple[Fault, ...] = ()

    journal: Journal

    def mode(self, region: type[Mode]) -> Mode:
        """Return the mode of one region."""
        return getattr(self, region.__name__.lower())

    @property
    def places(self) -> int:
        """Capacity of the result queue."""
        return QUEUE_PLACES if "buffer_results" in self.inputs.control else 1

    @property
    def watched(self) -> bool:
        """True while the PLC's heartbeat changes in time."""
        return Signal.PLC_SILENT in self.timers


def restarted(journal: Journal, at: Moment, station_lost_after_s: float) -> State:
    """Return the state at a start: disarmed, no state of the station, and the journal's content.

    A pending trigger is refused. No result is published before the PLC's first write, whose number of the last result
    that it took is newer than a journal that could not be written.

    Args:
        journal: of the run before.
        at: now; the counters start at 0.
        station_lost_after_s: how long an inspection that was running waits for the station.
    """
    changes: dict[str, Any] = {
        "boots": (journal.boots + 1) % 2**16,
        "epoch": (journal.epoch + 1) % 2**32,
        "asked_id": None,
    }
    if journal.command_result == COMMAND_RESULT.code("executing"):
        # Its answer was lost with the process: whether it was carried out is unknown.
        changes["command_result"] = COMMAND_RESULT.code("timed_out")
    if journal.asked_id is not None:
        changes["disowned"] = (*journal.disowned, journal.asked_id)[-MOST_DISOWNED:]
    state = State(
        reset_utc_ms=at.utc_ms,
        journal=journal.model_copy(update=changes),
        queue=journal.queue,
        result=Result.WITHHELD,
    )
    if journal.asked_id is not None:
        state.last_refusal, state.last_refused_id, state.missed = Refusal.STATION_LOST, journal.asked_id, True
        state.counters = {**state.counters, "count_triggers": 1, "count_missed": 1}
    if journal.running is not None:
        # How long it has run is known by UTC only: the monotonic clock may have started anew since.
        ran_s = max(0.0, (at.utc_ms - journal.running.began_utc_ms) / 1000)
        state.running = journal.running.model_copy(update={"began_s": at.s - ran_s})
        state.inspection = Inspection.RUNNING
        state.timers = {
            Signal.STATION_SILENT: at.s + station_lost_after_s,
            Signal.RESULT_DEADLINE: at.s + journal.running.within_s,
        }
    return state
