"""Zones and conduits of the station (IEC 62443-3-2), from its configuration.

A zone is a group of machines with the same trust; a conduit is one connection between two zones. Everything else is
closed.
"""

from enum import StrEnum
from typing import NamedTuple

from station.settings.configuration import Configuration

ARM_PORTS = {
    30004: "RTDE: state and commands",
    30003: "the driver's program",
    29999: "dashboard: play, stops, recovery",
}
"""Of a UR controller; ur-rtde has no other choice."""


class Zone(StrEnum):
    """Security zone: a group of machines with the same trust."""

    CELL = "cell"
    LINE = "line"
    STATION = "station"
    OPERATORS = "operators"
    MONITORING = "monitoring"
    ARCHIVE = "archive"


MEANING = {
    Zone.CELL: "the arm's controller with its safety functions, the gripper, a serial gateway",
    Zone.LINE: "the line's PLC, and what commissions it",
    Zone.STATION: "this machine",
    Zone.OPERATORS: "panels, tablets, the office of quality",
    Zone.MONITORING: "Prometheus, Alertmanager",
    Zone.ARCHIVE: "PostgreSQL, MQTT broker",
}


class Conduit(NamedTuple):
    """One connection between zones, opened from one side."""

    source: Zone
    target: Zone
    protocol: str
    host: str
    """The listening address, if the station is the target; else the called host."""
    port: int
    setting: str
    """The setting of the port, or of the host if the port is fixed."""
    carries: str
    protected: str
    """By what its content is, beyond the network."""
    peers: tuple[str, ...] = ()
    """The only permitted clients, if a setting restricts them; empty if the firewall alone decides."""
    enabled: bool = True


def conduits(site: Configuration) -> tuple[Conduit, ...]:
    """Return all conduits, including those that this configuration closes."""
    return (*_listened(site), *_called(site))


def _listened(site: Configuration) -> tuple[Conduit, ...]:
    modbus, hmi, metrics = site.modbus, site.hmi, site.metrics
    station = Zone.STATION
    return (
        Conduit(
            Zone.LINE, station, "Modbus TCP", modbus.host, modbus.port, "modbus.port",
            "triggers, outcomes, orders", "modbus.readers and modbus.writers", modbus.readers,
        ),
        Conduit(
            Zone.LINE, station, "Modbus TCP over TLS", modbus.host, modbus.tls.port, "modbus.tls.port",
            "the same", "TLS 1.3, certificates of both sides, roles", modbus.readers, modbus.tls.enabled,
        ),
        Conduit(
            Zone.OPERATORS, station, "HTTPS" if hmi.tls.enabled else "HTTP", hmi.host, hmi.port, "hmi.port",
            "pages, API", "PINs and roles; TLS with hmi.tls",
        ),
        Conduit(
            Zone.MONITORING, station, "HTTP", metrics.host, metrics.port, "metrics.port",
            "metrics and health, to be read", "nothing: the firewall alone",
        ),
    )  # fmt: skip


def _called(site: Configuration) -> tuple[Conduit, ...]:
    urcap, rtu = site.gripper.urcap, site.gripper.modbus_rtu
    postgresql, mqtt, twin = site.outbox.postgresql, site.outbox.mqtt, site.camera.twin
    station = Zone.STATION
    return (
        *(
            Conduit(
                station, Zone.CELL, "UR", site.arm.host, port, "arm.host", carries,
                "nothing: a network of the cell alone", enabled=not site.service.bench,
            )
            for port, carries in ARM_PORTS.items()
        ),
        Conduit(
            station, Zone.CELL, "URCap socket", urcap.host, urcap.port, "gripper.urcap.port",
            "the gripper", "as the arm", enabled=site.gripper.driver == "urcap",
        ),
        Conduit(
            station, Zone.CELL, "Modbus RTU over TCP", rtu.host, rtu.port, "gripper.modbus_rtu.port",
            "the gripper", "as the arm", enabled=site.gripper.driver == "modbus_rtu" and rtu.line == "tcp",
        ),
        Conduit(
            station, Zone.CELL, "frames of the twin", twin.host, twin.port, "camera.twin.port",
            "images, in demonstrations alone", "nothing", enabled=site.camera.driver == "twin",
        ),
        Conduit(
            station, Zone.ARCHIVE, "PostgreSQL", postgresql.host, postgresql.port, "outbox.postgresql.port",
            "inspections, lots, audit trail", "password, outbox.postgresql.tls", enabled=postgresql.enabled,
        ),
        Conduit(
            station, Zone.ARCHIVE, "MQTT", mqtt.host, mqtt.port, "outbox.mqtt.port",
            "the same as events", "password, outbox.mqtt.tls", enabled=mqtt.enabled,
        ),
    )  # fmt: skip
