"""`station plc check-can`: check of the CAN bus and its nodes."""

import time
from collections import Counter
from pathlib import Path

import click

from plc_interface.outputs.can import bring_up
from plc_interface.outputs.can.errors import BringUpError, LineIoError
from plc_interface.outputs.can.link import STATES, CanLink, described
from station.config_option import config_option
from station.messages.message import Message
from station.settings.can import CanSettings
from station.settings.configuration import load_configuration


@click.command("check-can")
@config_option
def check_can(config: Path | None) -> None:
    """Read the identity of the CAN nodes; nothing is moved or written. Only while the station is stopped.

    For the interface and for each node it prints the result and what to do. The exit code is 1 if anything is faulty.
    The station has to be stopped because a bus has one master at a time.
    """
    settings = load_configuration(config).can
    if not settings.enabled:
        click.echo("CAN is off, the line's PLC diverts; set can.enabled to use it")
        return
    counters: Counter[str] = Counter()
    link = CanLink(settings, counters)
    faulty: list[Message] = []
    try:
        click.echo(f"{click.style('ok      ', fg='green')}{described(settings)}")
        sheets = bring_up.read_data_sheets(settings)
        gate = bring_up.make_gate(link.network, settings, sheets)
        encoder = bring_up.make_encoder(link.network, settings, sheets)
        for node in (gate, encoder):
            try:
                found = _check_node(link, node, settings)
            except LineIoError as error:
                faulty.append(node.name)
                click.echo(f"{click.style('fault   ', fg='red')}{error}")
            else:
                click.echo(f"{click.style('ok      ', fg='green')}{node.name}: {found}")
    finally:
        link.close()
    if faulty:
        raise LineIoError(f"not usable: {', '.join(map(str, faulty))}")


def _check_node(link: CanLink, node: bring_up.Node, settings: CanSettings) -> str:
    """Return identity, heartbeat and mapping as text, and the encoder's count.

    Raises:
        LineIoError: no heartbeat, another device, or no answer.
    """
    deadline_s = time.monotonic() + bring_up.NODE_DEADLINE_S
    while node.number not in link.beats:
        link.check()
        if time.monotonic() > deadline_s:
            raise BringUpError(bring_up.no_heartbeat(node, settings))
        time.sleep(bring_up.POLL_S)
    identity = bring_up.verify_identity(node)
    is_gate = node.number == settings.gate_node
    foreign = bring_up.foreign_mapping(node, (bring_up.gate_pdos if is_gate else bring_up.encoder_pdos)(node, settings))
    mapping = (
        "another mapping, which the station writes at its start" if foreign else "mapping as the station writes it"
    )
    state = link.beats[node.number].state
    count = "" if is_gate else f", count {bring_up.read_position(node)}"
    return f"{identity}, heartbeat {STATES.get(state, f'in state {state}')}, {mapping}{count}"
