"""The encoder's count in a PLC's write, where the output has the encoder."""

import asyncio
import contextlib

from plc_interface.handshake import events as ev
from plc_interface.outputs.line_output import NoOutput
from plc_interface.process.interface import Interface
from plc_interface.process.journal_file import JournalFile
from plc_interface.registers.codec import WordOrder
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer
from station.settings.plc import HandshakeSettings


class FirstCount(NoOutput):
    """An output that becomes ready by the encoder's first count, which comes as its readiness is read."""

    count: int | None = None

    @property
    def ready(self) -> bool:  # pyrefly: ignore[bad-override]
        self.count = 5000
        return True

    def encoder_count(self) -> int | None:
        return self.count


def test_a_write_by_which_the_output_becomes_ready_has_the_encoders_count(tmp_path, short_folder, monkeypatch):
    async def main():
        with contextlib.closing(JournalFile(tmp_path)) as journal:
            image, endpoint = RegisterImage(WordOrder.HIGH_FIRST), f"ipc://{short_folder}/line.ipc"
            interface = Interface(HandshakeSettings(), endpoint, image, journal, output := FirstCount())
            events = []
            monkeypatch.setattr(interface, "feed", events.append)
            output.count = None
            interface.on_write(Peer("127.0.0.1", 50_000, may_write=True), {"encoder": 0})
            await interface.stop()
            return next(each for each in events if isinstance(each, ev.PlcWrote))

    assert asyncio.run(main()).inputs.encoder == 5000
