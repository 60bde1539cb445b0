"""`station outbox`: publish inspections, lots and the audit trail to other systems."""

import asyncio
import contextlib
import time
from pathlib import Path

import click

from station.commands.signals import on_end_signals
from station.config_option import config_option
from station.errors import StationError
from station.logs import configure_logging
from station.outbox.lag import LOST_S
from station.outbox.publisher import destinations, run_outbox
from station.outbox.status import outbox_folder, read_status
from station.settings.configuration import Configuration, load_configuration
from station.settings.last_good import load_or_last_good
from station.supervision.notify import feed_watchdog, notify


@click.group()
def outbox() -> None:
    """Publish inspections, lots and the audit trail to other systems: PostgreSQL, MQTT."""


@outbox.command()
@config_option
def run(config: Path | None) -> None:
    """Publish until SIGTERM or Ctrl-C; `station run` starts this by itself if a destination is enabled.

    It reads the records and never writes them; what cannot be published now is published later, in order.
    """
    configure_logging("outbox")
    site, _ = load_or_last_good(config)
    asyncio.run(_until_ended(site))


@outbox.command()
@config_option
def status(config: Path | None) -> None:
    """Show each destination's delay; exit code 1 if one is delayed by a lost connection."""
    site = load_configuration(config)
    said = read_status(outbox_folder(site.home))
    wanted = [each.name for each in destinations(site.outbox, site.home)]
    if not wanted:
        click.echo("no destination is enabled: see outbox.postgresql and outbox.mqtt in docs/outbox.md")
        return
    if said is None:
        raise StationError("the outbox has never run here; start `station run`, or `station outbox run`")
    for name, each in said.destinations.items():
        waiting = "unknown how many wait" if each.waiting is None else f"{each.waiting} wait"
        oldest = (
            "" if each.oldest_utc_ms is None else f", the oldest for {time.time() - each.oldest_utc_ms / 1000:.0f} s"
        )
        connected = "connected" if each.connected else f"not connected: {each.error}"
        click.echo(f"{name}: {each.told} published, {waiting}{oldest}, {each.refused} refused; {connected}")
    if said.age_s > LOST_S:
        raise StationError(
            f"the outbox was last heard {said.age_s:.0f} s ago; start `station run`, or `station outbox run`"
        )
    if not all(each.connected for each in said.destinations.values()):
        raise StationError("not all destinations are connected; what waits is published when they are")


async def _until_ended(site: Configuration) -> None:
    ended, heard_s = asyncio.Event(), time.monotonic()

    def progress() -> None:
        nonlocal heard_s
        heard_s = time.monotonic()

    on_end_signals(ended.set)
    tasks = [
        asyncio.create_task(run_outbox(site.outbox, site.home, progress), name="outbox"),
        asyncio.create_task(feed_watchdog(lambda: time.monotonic() - heard_s < LOST_S), name="watchdog"),
        asyncio.create_task(ended.wait(), name="order to end"),
    ]
    notify("READY=1")
    click.echo("running; SIGTERM or Ctrl-C ends it")
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        if task.done():
            task.result()
        task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await asyncio.gather(*tasks, return_exceptions=True)
