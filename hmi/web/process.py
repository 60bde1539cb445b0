"""HMI process: serves the pages until SIGINT or SIGTERM."""

import asyncio
import gc
import logging
import signal
import ssl
from pathlib import Path

from starlette.types import ASGIApp

from hmi.web.app import make_app, make_context
from station.errors import BadInputError
from station.serving.guard import GuardedListener, Limits
from station.serving.server import AddressError, Server, listen
from station.settings.configuration import Configuration
from station.settings.hmi import HmiSettings, address_of
from station.supervision.notify import feed_watchdog, notify

START_S = 30.0
MOST_CONNECTIONS, RESERVED_CONNECTIONS = 200, 200
"""Of all strangers together; of the station's own screen and the addresses where people have logged in."""
CONNECTIONS_PER_PAGE = 3
LOOPBACK = ("127.", "::1", "localhost")

log = logging.getLogger(__name__)


async def serve(site: Configuration, file: Path | None, broken: str) -> None:
    """Serve the pages until SIGINT or SIGTERM; the arguments are those of `make_context`.

    Raises:
        StationError: the address, a certificate or the user store cannot be used.
    """
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    hmi = make_context(site, file, broken)
    limits = Limits(MOST_CONNECTIONS, CONNECTIONS_PER_PAGE * site.hmi.pages_per_address, RESERVED_CONNECTIONS)
    listener = listen(site.hmi.host, site.hmi.port, "hmi", "the pages", limits, hmi.pins.knows)
    hmi.gateway.flooded_by = lambda: listener.flooded_by
    server = _server(listener, site.hmi, make_app(hmi))
    serving = asyncio.create_task(server.run_until_exit(), name="pages")
    feeding: asyncio.Task[None] | None = None
    try:
        async with asyncio.timeout(START_S):
            while not server.started:
                if serving.done():
                    serving.result()
                    raise AddressError("the pages' server ended at once; see the log")
                await asyncio.sleep(0.01)
        if not site.hmi.tls.enabled and not site.hmi.host.startswith(LOOPBACK):
            log.warning("the pages are served on %s without TLS: PINs can be read on the network", site.hmi.host)
        log.info("the pages are served on %s", address_of(site.hmi))
        gc.collect()
        gc.freeze()  # so that later collections are short
        feeding = asyncio.create_task(feed_watchdog(lambda: True), name="watchdog")
        notify("READY=1")
        waiting = asyncio.create_task(ended.wait(), name="order to end")
        await asyncio.wait({serving, waiting}, return_when=asyncio.FIRST_COMPLETED)
        waiting.cancel()
    finally:
        if feeding is not None:
            feeding.cancel()
        hmi.live.ending = server.should_exit = True
        await serving


def _server(listener: GuardedListener, settings: HmiSettings, app: ASGIApp) -> Server:
    """Make the server, and read its certificate."""
    tls = settings.tls
    server = Server(
        listener,
        app,
        ssl_certfile=tls.certificate if tls.enabled else None,
        ssl_keyfile=tls.key if tls.enabled else None,
    )
    try:
        server.config.load()
    except OSError as error:
        raise BadInputError(
            f"hmi.tls: {tls.certificate} and {tls.key} cannot be used: {error}; name a certificate and its key in PEM"
        ) from error
    if server.config.ssl is not None:
        server.config.ssl.minimum_version = ssl.TLSVersion.TLSv1_2
    return server
