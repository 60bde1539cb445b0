"""The HMI as a process: pages served until told to end."""

import asyncio
import contextlib
import errno
import logging
import signal
import socket
import ssl
from collections.abc import Iterator

import uvicorn

from hmi.app import make_app, make_context
from station.errors import BadInputError, StationError
from station.settings.configuration import Configuration
from station.settings.hmi import HmiSettings, address_of
from station.supervision.notify import feed_watchdog, notify

START_S = 30.0
CLOSE_S = 1.0
LOOPBACK = ("127.", "::1", "localhost")

log = logging.getLogger(__name__)


class AddressError(StationError):
    """The pages' address cannot be listened on."""


class _Server(uvicorn.Server):
    """A server that leaves the process's signals to `serve`."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


async def serve(site: Configuration) -> None:
    """Serve the pages until SIGINT or SIGTERM.

    Args:
        site: the site's configuration.

    Raises:
        StationError: the address, a certificate or the people's file cannot be used.
    """
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    hmi = make_context(site)
    listener = _listen(site.hmi)
    server = _Server(_config(site.hmi, make_app(hmi)))
    serving = asyncio.create_task(server.serve(sockets=[listener]), name="pages")
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


def _config(settings: HmiSettings, app: object) -> uvicorn.Config:
    tls = settings.tls
    config = uvicorn.Config(
        app,  # type: ignore[arg-type] (an ASGI application)
        log_config=None,
        access_log=False,
        ws="none",
        server_header=False,
        proxy_headers=False,
        limit_concurrency=200,
        h11_max_incomplete_event_size=16 * 1024,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=CLOSE_S,  # type: ignore[arg-type]
        ssl_certfile=tls.certificate if tls.enabled else None,
        ssl_keyfile=tls.key if tls.enabled else None,
    )
    try:
        config.load()
    except (OSError, ssl.SSLError) as error:
        raise BadInputError(
            f"hmi.tls: {tls.certificate} and {tls.key} cannot be used: {error}; name a certificate and its key in PEM"
        ) from error
    if config.ssl is not None:
        config.ssl.minimum_version = ssl.TLSVersion.TLSv1_2
    return config


def _listen(settings: HmiSettings) -> socket.socket:
    """A listening socket, or one clear sentence."""
    host, port = settings.host, settings.port
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise AddressError(f"hmi.host {host!r}: {error.strerror}; set an address of this machine") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(64)
        listener.settimeout(0)
    except OSError as error:
        listener.close()
        why = {
            errno.EADDRINUSE: "another program listens there; stop it, or set another hmi.port",
            errno.EADDRNOTAVAIL: "that is no address of this machine; set another hmi.host",
            errno.EACCES: "this user may not listen on so low a port; set hmi.port to 1024 or more",
        }.get(error.errno or 0, f"{error.strerror}; set another hmi.host or hmi.port")
        raise AddressError(f"the pages cannot be served on {host}:{port}: {why}") from error
    return listener
