"""The lot in force over a start of the interface."""

import asyncio
import contextlib

from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Lot
from plc_interface.handshake.state import Fault
from plc_interface.outputs.line_output import NoOutput
from plc_interface.process.interface import Interface
from plc_interface.process.journal_file import JournalFile
from plc_interface.registers.codec import WordOrder
from plc_interface.registers.map import BY_NAME
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer
from plc_interface.server.write_lock import WriterChange
from station.settings.plc import HandshakeSettings

PEER = Peer("127.0.0.1", 50_000, may_write=True)
LATCH = BY_NAME["control"].flags(["latch_lot"])


def latched(folder, endpoint, *writes):
    """Return the state of an interface that has started with the lot L5 in force, after a PLC's writes."""

    async def main():
        with contextlib.closing(JournalFile(folder)) as journal:
            journal.write(Journal(lot="L5"), durable=False)
            image = RegisterImage(WordOrder.HIGH_FIRST)
            interface = Interface(HandshakeSettings(), endpoint, image, journal, NoOutput())
            interface.on_writer(PEER, WriterChange.CLAIMED)
            for values in writes:
                interface.on_write(PEER, values)
            await interface.stop()
            return interface._state

    return asyncio.run(main())


def test_a_latch_without_a_lot_keeps_the_one_in_force(tmp_path, short_folder):
    state = latched(tmp_path, f"ipc://{short_folder}/line.ipc", {"control": LATCH})
    assert (state.journal.lot, state.lot, state.faults) == ("L5", Lot.OPEN, (Fault.BAD_LOT,))


def test_a_lot_that_was_written_is_latched_also_an_empty_one(tmp_path, short_folder):
    for number, writes in enumerate((({"lot": ""}, {"control": LATCH}), ({"lot": "", "control": LATCH},))):
        state = latched(tmp_path / str(number), f"ipc://{short_folder}/line.ipc", *writes)
        assert (state.journal.lot, state.lot, state.faults) == ("", Lot.LATCHED, ())
