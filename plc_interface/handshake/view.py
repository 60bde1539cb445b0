"""Register values of a state, by the names of the register map; and the line's state for the station."""

import zlib
from collections.abc import Mapping

from plc_interface.handshake.modes import Arming, Command, Inspection, Link, Lot, Result, Service, Trigger
from plc_interface.handshake.state import State
from plc_interface.handshake.trigger import obstacle
from plc_interface.registers.alarms import alarm_values
from plc_interface.registers.map import BY_NAME, RESULT
from plc_interface.registers.register import Value
from station.channel.line import PACKML_STATE_NUMBERS, Line, LineFault, Outcome, StationState

STATION_LOST_CODE = 1000
"""In `error_code` while the station does not answer; its alarms have the numbers below."""

_STATUS, _MORE_STATUS = BY_NAME["status"], BY_NAME["more_status"]
_INHIBITED = {Arming.DISARMED, Arming.WITHDRAWN}
_FLAGS, _REASONS = BY_NAME["result_flags"], BY_NAME["result_reasons"]
_OUTCOMES, _REFUSALS = BY_NAME["result_outcome"], BY_NAME["last_refusal"]


def view(state: State) -> dict[str, Value]:
    """Return every register that the handshake sets: status, result and counters.

    The station's values are cleared once it is lost.
    """
    return {**_status(state), **_result(state), **state.counters, "counters_epoch": state.journal.epoch,
            "counters_reset_utc_ms": state.reset_utc_ms}  # fmt: skip


def line(state: State, counters: Mapping[str, int], faults: tuple[LineFault, ...]) -> Line:
    """Return the line's state, sent to the station with every beat."""
    return Line(
        plc_connected=state.writer,
        plc_alive=state.watched,
        enabled=state.arming is Arming.ARMED,
        enable_withdrawn=state.arming is Arming.WITHDRAWN,
        waiting=len(state.queue),
        counters={**state.counters, **counters},
        faults=(*(LineFault(part="handshake", what=fault.message) for fault in state.faults), *faults),
    )


def _status(state: State) -> dict[str, Value]:
    journal, station = state.journal, state.station
    taken = len(state.queue) + (state.inspection is not Inspection.NONE)
    running = state.running
    return {
        "status": _STATUS.flags(_status_bits(state)),
        "packml_state": PACKML_STATE_NUMBERS[station.packml_state] if station and station.packml_state else 0,
        "packml_mode": station.mode if station else 0,
        "accepted_trigger_id": journal.accepted_id,
        "station_heartbeat": state.heartbeat,
        "plc_heartbeat_echo": state.inputs.plc_heartbeat,
        "command_sequence_echo": journal.command_sequence or 0,
        "command_result": journal.command_result,
        "active_recipe": station.recipe_number if station else 0,
        "active_recipe_checksum": station.recipe_checksum if station else 0,
        # More may wait than there are places: `buffer_results` can be cleared meanwhile.
        "free_places": max(0, state.places - taken),
        "waiting_results": len(state.queue),
        "error_code": station.error_code if station else STATION_LOST_CODE,
        **alarm_values(station.alarms if station else 0),
        "more_status": _MORE_STATUS.flags(["enable_inhibited"] if state.arming in _INHIBITED else []),
        "last_refusal": _REFUSALS.code(state.last_refusal.value) if state.last_refusal else 0,
        "last_refused_trigger_id": state.last_refused_id,
        "latched_lot_checksum": lot_checksum(journal.lot),
        "acknowledged_sequence_echo": journal.acknowledged,
        **({"result_deadline_ms": round(1000 * running.within_s)} if running else {}),
        "interface_boots": journal.boots,
        "station_boots": state.station_boots,
    }


def _status_bits(state: State) -> list[str]:
    station = state.station
    bits = {
        "online": state.link is Link.UP and state.service is Service.IN_SERVICE,
        "trigger_ready": obstacle(state) is None and station is not None and station.ready,
        "trigger_acknowledged": state.trigger in {Trigger.ANSWERED, Trigger.HELD},
        "acquiring": state.acquiring,
        "inspecting": state.inspection is Inspection.RUNNING,
        "result_valid": state.result is Result.PUBLISHED,
        "overrun": state.overrun,
        "missed": state.missed,
        "command_executing": state.command is Command.EXECUTING,
        "command_done": state.command is Command.DONE,
        "command_failed": state.command is Command.FAILED,
        "error": state.link is not Link.UP or _is_faulted(station),
        "toggle": state.toggle,
        "lot_latched": state.lot is Lot.LATCHED,
        "writer_owned": state.writer,
        "simulated": station is not None and station.simulated,
    }
    return [name for name, is_set in bits.items() if is_set]


def _is_faulted(station: StationState | None) -> bool:
    return station is None or station.error_code != 0 or not station.healthy


def _result(state: State) -> dict[str, Value]:
    published = state.queue[0] if state.result is Result.PUBLISHED else None
    return _NO_RESULT if published is None else result_values(published)


def result_values(outcome: Outcome) -> dict[str, Value]:
    """Return the result block of an outcome; areas and closing beyond their registers' bounds are set to the bound."""
    area = outcome.area_mm2
    flags = {
        "pass": outcome.outcome == "PASS",
        "area_valid": area is not None,
        "late": outcome.late,
        "partial": outcome.partial,
        "simulated": outcome.simulated,
    }
    return {
        "result_sequence": outcome.sequence,
        "result_trigger_id": outcome.trigger_id,
        "result_flags": _FLAGS.flags(name for name, is_set in flags.items() if is_set),
        "result_reasons": _REASONS.flags(reason.value for reason in outcome.reasons),
        "result_area_mm2_x100": None if area is None else _bounded(100 * area, 0, 2**31 - 1),
        "result_area_mm2": None if area is None else min(area, 3.4e38),
        # One end of this register's range, and of the closing's, means none: the bound is one short of it.
        "result_area_px": None if outcome.area_px is None else min(outcome.area_px, 2**32 - 2),
        "result_closing_mm_x100": (
            None if outcome.closing_mm is None else _bounded(100 * outcome.closing_mm, -(2**15) + 1, 2**15 - 1)
        ),
        "result_confidence_pct": None if outcome.confidence is None else round(100 * outcome.confidence),
        "result_recipe": outcome.recipe_number,
        "result_outcome": _OUTCOMES.code(outcome.outcome),
        "result_recipe_checksum": outcome.recipe_checksum,
        "result_ended_utc_ms": outcome.ended_utc_ms,
        "result_duration_ms": outcome.duration_ms,
        "result_encoder": outcome.encoder,
        "result_lot_checksum": lot_checksum(outcome.lot),
        "result_sequence_again": outcome.sequence,
        "result_fruit_length_mm_x10": outcome.fruit_length_mm_x10,
        "result_size_class": outcome.size_class,
        "result_sequence_end": outcome.sequence,
    }


_NO_RESULT: dict[str, Value] = {register.name: 0 if register.invalid is None else None for register in RESULT}


def lot_checksum(lot: str) -> int:
    """Return the CRC-32 of a lot id in ASCII, 0 for none."""
    return zlib.crc32(lot.encode("ascii", "replace")) if lot else 0


def _bounded(value: float, low: int, high: int) -> int:
    return round(min(max(value, low), high))
