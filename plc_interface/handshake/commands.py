"""The PLC's commands, each carried out once."""

from plc_interface.handshake.actions import RequestCommand
from plc_interface.handshake.journal import COMMAND_RESULT
from plc_interface.handshake.modes import Command, Link, Signal
from plc_interface.handshake.state import Fault
from plc_interface.handshake.work import Effect, Row, Work, described, row
from plc_interface.registers.map import BY_NAME
from station.channel.line import CommandName

_CODES = BY_NAME["command_code"].codes


def is_reused(work: Work) -> bool:
    """The sequence is that of the last command."""
    return work.state.inputs.command_sequence == work.state.journal.command_sequence


def is_repeated(work: Work) -> bool:
    """Sequence, code and argument are those of the last command."""
    inputs, journal = work.state.inputs, work.state.journal
    content = journal.command_code, journal.command_argument
    return is_reused(work) and content in {(None, None), (inputs.command_code, inputs.command_argument)}


def is_done_already(work: Work) -> bool:
    """Sequence, code and argument are those of the last command, which is done."""
    return is_repeated(work) and work.state.journal.command_result == COMMAND_RESULT.code("done")


def is_no_command(work: Work) -> bool:
    """The command code is unknown."""
    return work.state.inputs.command_code not in _CODES or work.state.inputs.command_code == 0


station_is_lost = described("The station is lost.", lambda work: work.state.link is not Link.UP)
bit_is_high = described("The bit is high.", lambda work: "execute_command" in (work.state.seen or ()))


def note_command(work: Work) -> None:
    """Echo the sequence."""
    inputs = work.state.inputs
    work.update_journal(
        command_sequence=inputs.command_sequence,
        command_code=inputs.command_code,
        command_argument=inputs.command_argument,
    )


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
        work.state.command_request = None

    return described(f"Result {name}.", note)


watch = described("Start the execute bit's time-out.", lambda work: work.watch_bit(Signal.EXECUTE_TIMEOUT))
end_watch = described("Stop the time-out.", lambda work: work.stop(Signal.EXECUTE_TIMEOUT))
not_reset = described("Fault: execute bit not reset in time.", lambda work: work.fault(Fault.EXECUTE_NOT_RESET))
reused = described(
    "Fault: another command under the last one's sequence.", lambda work: work.fault(Fault.COMMAND_REUSED)
)
busy = described("Fault: command while another one is executed.", lambda work: work.fault(Fault.COMMAND_BUSY))


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
        row(mode, on, note_command, reused, result("failed"), watch, to=FAILED, when=is_reused),
        row(mode, on, note_command, result("no_command"), watch, to=FAILED, when=is_no_command),
        row(mode, on, note_command, result("station_lost"), watch, to=FAILED, when=station_is_lost),
        # `request` follows `result`, which clears the number of the pending request.
        row(mode, on, note_command, result("executing"), end_watch, request, to=EXECUTING),
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
