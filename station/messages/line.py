"""Messages of the PLC interface: faults of the handshake and of its files."""

from station.messages.message import define

PLC_SILENT = define("line.plc_silent", "the PLC's heartbeat did not change: check the PLC, then give enable again")
WRITER_LOST = define("line.writer_lost", "the writing PLC's connection was lost: connect, then give enable again")
TRIGGER_NOT_RESET = define(
    "line.trigger_not_reset", "the PLC did not reset its trigger bit: reset it after trigger_acknowledged"
)
ACKNOWLEDGE_NOT_RESET = define(
    "line.acknowledge_not_reset", "the PLC did not reset its acknowledge bit: reset it when result_valid falls"
)
EXECUTE_NOT_RESET = define(
    "line.execute_not_reset", "the PLC did not reset its execute bit: reset it after command_done or command_failed"
)
LATCH_NOT_RESET = define("line.latch_not_reset", "the PLC did not reset its latch bit: reset it after lot_latched")
WRONG_ACKNOWLEDGEMENT = define(
    "line.wrong_acknowledgement",
    "the PLC acknowledged another sequence than the one shown: read result_sequence, and check the word order",
)
BAD_LOT = define(
    "line.bad_lot",
    "the lot id is not printable ASCII, or was not written since the interface started, and was not taken over: write "
    "it without a barcode reader's line end, and latch it again",
)
COMMAND_BUSY = define(
    "line.command_busy", "the PLC gave a command while another was carried out: wait for command_done or command_failed"
)
COMMAND_REUSED = define(
    "line.command_reused",
    "the PLC gave another command under the number of its last one, and it was not carried out: count "
    "command_sequence on from command_sequence_echo",
)
JOURNAL_NOT_WRITTEN = define(
    "line.journal_not_written",
    "the journal {file} cannot be written: {error}; until it can, a restart of the PLC interface may lose results",
)
JOURNAL_NOT_KEPT = define(
    "line.journal_not_kept",
    "the PLC interface cannot keep its journal in {folder}: {error}; give this user the right to write there, or set "
    "home to another folder",
)
ANOTHER_INTERFACE = define(
    "line.another_interface",
    "another PLC interface runs in {folder}: stop it, or give this one a home folder of its own",
)
