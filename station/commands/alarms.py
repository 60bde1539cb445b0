"""`station alarms`: list, acknowledge and shelve a running station's alarms."""

import asyncio
from pathlib import Path
from typing import TypeVar

import click

from station.by_option import by_option
from station.channel.client import ChannelClient
from station.channel.line import CommandDone
from station.channel.messages import ChannelMessage, DeadlineError
from station.channel.panel import (
    AcknowledgeAlarm,
    AlarmList,
    ListAlarms,
    ListedAlarm,
    ShelveAlarm,
    UnshelveAlarm,
)
from station.clock import formatted
from station.commands.site import site_or_last_good
from station.config_option import config_option
from station.errors import StationError
from station.inspection.alarms import LONGEST_SHELVED_S
from station.records.texts import printable
from station.settings.plc import line_endpoint

ReplyT = TypeVar("ReplyT", bound=ChannelMessage)
_DEADLINE_S = 5.0
_ROLE = "command line"
_LONGEST_MINUTES = int(LONGEST_SHELVED_S // 60)
_alarm = click.argument("alarm", metavar="ALARM")


@click.group()
def alarms() -> None:
    """List, acknowledge and shelve the alarms of the running station; docs/alarms.md explains each ALARM."""


@alarms.command("list")
@config_option
def listed(config: Path | None) -> None:
    """List the active alarms, most urgent first, with what to do; shelved ones come last."""
    found = asyncio.run(_ask(config, ListAlarms(), AlarmList)).alarms
    if not found:
        click.echo("no alarm is active")
    for each in sorted(found, key=lambda each: each.shelved_until_utc_ms is not None):
        click.echo(printable(_format(each)))


@alarms.command()
@_alarm
@by_option
@config_option
def acknowledge(alarm: str, by: str, config: Path | None) -> None:
    """Acknowledge ALARM. Repeating it changes nothing."""
    _order(config, AcknowledgeAlarm(alarm=alarm, who=by, role=_ROLE))
    click.echo(f"{alarm} is acknowledged")


@alarms.command()
@_alarm
@click.option(
    "--minutes",
    required=True,
    metavar="N",
    type=click.IntRange(1, _LONGEST_MINUTES),
    help=f"For how long, {_LONGEST_MINUTES} at most.",
)
@click.option("--reason", required=True, help="Why, for whoever asks later.")
@by_option
@config_option
def shelve(alarm: str, minutes: int, reason: str, by: str, config: Path | None) -> None:
    """Hide ALARM for a time, from the list and from the PLC. An alarm that needs a person's reset is never hidden."""
    _order(config, ShelveAlarm(alarm=alarm, who=by, role=_ROLE, reason=reason, for_s=60.0 * minutes))
    click.echo(f"{alarm} is shelved for {minutes} min")


@alarms.command()
@_alarm
@by_option
@config_option
def unshelve(alarm: str, by: str, config: Path | None) -> None:
    """Show ALARM again before its time is over. Repeating it changes nothing."""
    _order(config, UnshelveAlarm(alarm=alarm, who=by, role=_ROLE))
    click.echo(f"{alarm} is not shelved")


def _order(config: Path | None, request: ChannelMessage) -> None:
    done = asyncio.run(_ask(config, request, CommandDone))
    if not done.done:
        raise StationError(done.why or "")


async def _ask(config: Path | None, request: ChannelMessage, reply: type[ReplyT]) -> ReplyT:
    site = site_or_last_good(config)
    async with ChannelClient(line_endpoint(site.handshake, site.home), "the station") as station:
        try:
            return await station.request(request, reply, deadline_s=_DEADLINE_S)
        except DeadlineError as error:
            raise StationError(f"{error}; alarms are a running station's: see whether one runs") from error


def _format(each: ListedAlarm) -> str:
    times = "" if each.raised <= 1 else f", {each.raised} times"
    head = f"{each.alarm} ({each.priority}, {each.state}) since {formatted(each.since_utc_ms)}{times}"
    if each.shelved_until_utc_ms is not None:
        until = formatted(each.shelved_until_utc_ms)
        head = f"{each.alarm} ({each.priority}) is shelved until {until} by {each.shelved_by}"
    return "\n  ".join([head, str(each.detail or each.cause), f"{each.consequence} {each.action}"])
