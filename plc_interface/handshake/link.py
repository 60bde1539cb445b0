"""Link to the station over the channel: its state, its loss, its resynchronisation."""

from plc_interface.handshake.actions import RequestOpen
from plc_interface.handshake.events import Beat
from plc_interface.handshake.modes import Inspection, Link, Signal
from plc_interface.handshake.resynchronisation import resynchronise
from plc_interface.handshake.work import Work, described, row
from station.vocabulary import PackmlState

_AT_THE_FRUIT = {PackmlState.STARTING, PackmlState.EXECUTE}
"""Also where the interface knows of no accepted trigger: the station may have begun one that was refused as lost."""


def begins_refused_trigger(work: Work) -> bool:
    """The station is at a fruit, none is accepted, a trigger was refused as lost, and `Resume` is not pending."""
    state = work.state
    at_fruit = isinstance(work.event, Beat) and work.event.station.packml_state in _AT_THE_FRUIT
    disowned = at_fruit and state.inspection is Inspection.NONE and bool(state.journal.disowned)
    return disowned and none_is_pending(work)  # answers come slower than beats where the station's disk is slow


none_is_pending = described("`Resume` is not pending.", lambda work: work.state.open_request is None)


def store_state(work: Work) -> None:
    """Store the station's state, `acquiring` by it, wait for the next beat."""
    if not isinstance(work.event, Beat):
        return
    state, station = work.state, work.event.station
    if station.boot != state.last_boot:
        state.last_boot = station.boot
        state.station_boots = (state.station_boots + 1) % 2**16
    if work.event.asked_s < state.news_from_s:
        # It was sent before the last trigger was answered, so its readiness may be that of before the inspection.
        packml_state = None if state.station is None else state.station.packml_state
        station = station.model_copy(update={"ready": False, "packml_state": packml_state})
    state.station = station
    if station.packml_state is PackmlState.IDLE:
        state.acquiring = state.running is not None  # what the PLC waits for is ended by its outcome first
    elif station.packml_state in _AT_THE_FRUIT:
        state.acquiring = True
    work.start(Signal.STATION_SILENT, work.settings.station_lost_after_s)


def beat(work: Work) -> None:
    """Heartbeat to the PLC if the station is healthy."""
    if work.state.station is not None and work.state.station.healthy:
        work.state.heartbeat = (work.state.heartbeat + 1) % 2**16


def request_open(work: Work) -> None:
    """`Resume` to the station."""
    work.state.open_request = work.number()
    work.actions.append(RequestOpen(work.state.open_request))


def clear_request(work: Work) -> None:
    """Send `Resume` again at the next beat."""
    work.state.open_request = None


def clear_station(work: Work) -> None:
    """Clear the station's state."""
    work.state.station = None
    work.state.open_request = None
    work.log("the station does not answer: triggers are refused until it does")


LOST, RESUMING, UP = Link.LOST, Link.RESUMING, Link.UP

ROWS = (
    row(LOST, Signal.STATION_ANSWERED, store_state, request_open, to=RESUMING),
    row(LOST, Signal.STATION_RESTARTED, store_state, request_open, to=RESUMING),
    row(LOST, Signal.CHANNEL_FAILED),
    row(LOST, Signal.STATION_SILENT),
    row(RESUMING, Signal.STATION_ANSWERED, store_state, request_open, when=none_is_pending),
    row(RESUMING, Signal.STATION_ANSWERED, store_state),
    row(RESUMING, Signal.STATION_RESTARTED, store_state, request_open),
    row(RESUMING, Signal.OPENED, resynchronise, to=UP),
    row(RESUMING, Signal.STATION_BUSY),
    row(RESUMING, Signal.CHANNEL_FAILED, clear_request),
    row(RESUMING, Signal.STATION_SILENT, clear_station, to=LOST),
    row(UP, Signal.STATION_ANSWERED, store_state, beat, request_open, when=begins_refused_trigger),
    row(UP, Signal.STATION_ANSWERED, store_state, beat),
    row(UP, Signal.STATION_RESTARTED, store_state, request_open, to=RESUMING),
    row(UP, Signal.STATION_BUSY, request_open),
    row(UP, Signal.OPENED, resynchronise),
    row(UP, Signal.CHANNEL_FAILED, clear_request, to=RESUMING),
    row(UP, Signal.STATION_SILENT, clear_station, to=LOST),
)
