"""The PLC's commands, each carried out once."""

from plc_interface.handshake.actions import RequestCommand
from plc_interface.handshake.journal import COMMAND_RESULT
from plc_interface.handshake.modes import Command, Link, Signal
from plc_interface.handshake.state import Fault
from plc_interface.handshake.work import Effect, Row, Work, row
from plc_interface.registers.map import BY_NAME
from station.channel.line import CommandName

_CODES = BY_NAME["command_code"].codes


def is_repeated(work: Work) -> bool:
    """The sequence is that of the last command."""
    return work.state.inputs.command_sequence == work.state.journal.command_sequence


def is_done_already(work: Work) -> bool:
    """The sequence is that of the last command, which is done."""
    return is_repeated(work) and work.state.journal.command_result == COMMAND_RESULT.code("done")


def is_no_command(work: Work) -> bool:
    """The command code is unknown."""
    return work.state.inputs.command_code not in _CODES or work.state.inputs.command_code == 0


def station_is_lost(work: Work) -> bool:
    """The station is lost."""
    return work.state.link is not Link.UP


def bit_is_high(work: Work) -> bool:
    """The bit is high."""
    return "execute_command" in (work.state.seen or ())


def note_sequence(work: Work) -> None:
    """Echo the sequence."""
    work.update_journal(command_sequence=work.state.inputs.command_sequence)


def request(work: Work) -> None:
    """`Command` to the station."""
    state = work.state
    command = CommandName(_CODES[state.inputs.command_code].name)
    state.command_request = work.number()
    state.command_changes_recipe = command is CommandName.CHANGE_RECIPE
    work.actions.append(RequestCommand(state.command_request, command, state.inputs.command_argument))


def result(name: str) -> Effect:
    """Make an effect that sets the command's result."""

    def note(work: Work) -> None:
        work.update_journal(command_result=COMMAND_RESULT.code(name))
        if name != "executing":
            work.state.command_request = None

    note.__doc__ = f"Result {name}."
    return note


def watch(work: Work) -> None:
    """Start the execute bit's time-out."""
    work.start(Signal.EXECUTE_TIMEOUT, work.settings.handshake_timeout_s)


def end_watch(work: Work) -> None:
    """Stop the time-out."""
    work.stop(Signal.EXECUTE_TIMEOUT)


def not_reset(work: Work) -> None:
    """Fault: execute bit not reset in time."""
    work.fault(Fault.EXECUTE_NOT_RESET)


def busy(work: Work) -> None:
    """Fault: command while another one is executed."""
    work.fault(Fault.COMMAND_BUSY)


IDLE, EXECUTING, DONE, FAILED = Command.IDLE, Command.EXECUTING, Command.DONE, Command.FAILED


ANSWERS: tuple[tuple[Signal, str, Command], ...] = (
    (Signal.COMMAND_DONE, "done", DONE),
    (Signal.COMMAND_REFUSED, "failed", FAILED),
    (Signal.COMMAND_FAILED, "timed_out", FAILED),
    (Signal.STATION_SILENT, "station_lost", FAILED),
    (Signal.STATION_RESTARTED, "station_lost", FAILED),
)


def _at_rest(mode: Command) -> tuple[Row, ...]:
    """Return the rows of the modes in which no command is executed."""
    on = Signal.EXECUTE_ON
    return (
        row(mode, on, watch, to=DONE, when=is_done_already),
        row(mode, on, watch, to=FAILED, when=is_repeated),
        row(mode, on, note_sequence, result("no_command"), watch, to=FAILED, when=is_no_command),
        row(mode, on, note_sequence, result("station_lost"), watch, to=FAILED, when=station_is_lost),
        row(mode, on, note_sequence, result("executing"), end_watch, request, to=EXECUTING),
        row(mode, Signal.EXECUTE_OFF, end_watch, to=IDLE),
        row(mode, Signal.WRITER_LOST, end_watch, to=IDLE),
        row(mode, Signal.STATION_SILENT),
        row(mode, Signal.STATION_RESTARTED),
    )


def _answered(mode: Command) -> tuple[Row, ...]:
    return (
        row(mode, Signal.EXECUTE_TIMEOUT, not_reset, to=IDLE, when=bit_is_high),
        row(mode, Signal.EXECUTE_TIMEOUT, to=IDLE),
    )


ROWS: tuple[Row, ...] = (
    *_at_rest(IDLE),
    row(EXECUTING, Signal.EXECUTE_ON, when=is_repeated),
    row(EXECUTING, Signal.EXECUTE_ON, busy),
    row(EXECUTING, Signal.EXECUTE_OFF),
    row(EXECUTING, Signal.WRITER_LOST),
    *(row(EXECUTING, signal, result(name), watch, to=mode) for signal, name, mode in ANSWERS),
    *_at_rest(DONE),
    *_answered(DONE),
    *_at_rest(FAILED),
    *_answered(FAILED),
)
