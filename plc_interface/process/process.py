"""PLC interface process: serves registers, runs the handshake, until SIGINT or SIGTERM."""

import asyncio
import logging
import signal
from importlib.metadata import version

from plc_interface.outputs.line_output import make_output
from plc_interface.process.interface import Interface
from plc_interface.process.journal_file import JournalFile
from plc_interface.process.real_time import request_real_time_priority
from plc_interface.registers.codec import WordOrder
from plc_interface.server.image import RegisterImage
from plc_interface.server.server import ModbusServer
from station.settings.configuration import Configuration
from station.settings.plc import line_endpoint
from station.supervision.notify import feed_watchdog, notify

JOURNAL_FOLDER = "plc"
GOODBYE_S = 0.3
"""At the end a PLC that scans every 100 ms can read that the station is offline before its connection closes."""

log = logging.getLogger(__name__)


async def serve(configuration: Configuration) -> None:
    """Serve until SIGINT or SIGTERM; then report offline, close the connections and return.

    Raises:
        StationError: a port, a certificate, the journal's folder or the endpoint cannot be used.
    """
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    modbus, handshake = configuration.modbus, configuration.handshake
    endpoint = line_endpoint(handshake, configuration.home)
    journal = JournalFile(configuration.home / JOURNAL_FOLDER)
    output = make_output(configuration.can, configuration.home / JOURNAL_FOLDER)
    image = RegisterImage(WordOrder(modbus.word_order))
    image.commit(
        {
            "software_version": version("fruit-station")[:16],
            "plc_heartbeat_timeout_ms": round(1000 * handshake.plc_heartbeat_timeout_s),
            "writer_lease_ms": round(1000 * modbus.writer_lease_s),
            "handshake_timeout_ms": round(1000 * handshake.handshake_timeout_s),
            "station_heartbeat_ms": round(1000 * handshake.beat_period_s),
        }
    )
    interface = Interface(handshake, endpoint, image, journal, output)
    server = ModbusServer(modbus, image, interface.on_write, interface.on_writer)
    feeding: asyncio.Task[None] | None = None
    try:
        await server.start()
        request_real_time_priority()
        interface.start(server.statistics)
        await output.start()
        feeding = asyncio.create_task(feed_watchdog(lambda: True))
        notify("READY=1")
        tls = f", with TLS on port {modbus.tls.port}" if modbus.tls.enabled else ""
        log.info("Modbus TCP is served on %s, port %d%s, unit %d", modbus.host, modbus.port, tls, modbus.unit)
        await ended.wait()
        log.info("ending: the PLC reads offline, then its connection closes")
        interface.leave()
        await asyncio.sleep(GOODBYE_S)
    finally:
        if feeding is not None:
            feeding.cancel()
        await server.stop()
        await interface.stop()
        await output.stop()
        # Last: until here this process may write files in the journal's folder, and no second interface may start.
        journal.close()
