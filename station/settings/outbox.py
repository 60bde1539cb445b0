"""Outbox settings: the systems that receive inspections, lots and the audit trail."""

from typing import Literal

from pydantic import model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.network import Host, Port
from station.settings.paths import File
from station.settings.problems import FieldError


class OutboxPostgresqlSettings(Settings):
    """A PostgreSQL that many stations write to."""

    enabled: bool = setting(default=False, title="Written", description="Whether rows are written to PostgreSQL.")
    host: str = setting(
        "127.0.0.1",
        title="Address",
        description="Name or address of the server, or the folder of its UNIX socket.",
        min_length=1,
        max_length=253,
    )
    port: Port = setting(5432, title="Port", description="TCP port of the server.")
    database: str = setting("fruit", title="Database", description="Its name.", min_length=1, max_length=63)
    user: str = setting("fruit_station", title="User", description="The role that writes.", min_length=1, max_length=63)
    password_file: File | None = setting(
        None,
        title="Password's file",
        description="File whose first line is the password, readable by the station's user alone; null takes "
        "PGPASSWORD of the environment, or what libpq finds by itself (~/.pgpass, a certificate).",
    )
    tls: Literal["disable", "prefer", "require", "verify-full"] = setting(
        "prefer",
        title="TLS",
        description="As libpq's sslmode; verify-full in any network that is not the station's own.",
    )


class OutboxMqttSettings(Settings):
    """An MQTT broker with any number of subscribers."""

    enabled: bool = setting(default=False, title="Published", description="Whether events are published over MQTT.")
    host: Host = setting("127.0.0.1", title="Address", description="Name or address of the broker.", max_length=253)
    port: Port = setting(1883, title="Port", description="TCP port of the broker; 8883 with TLS.")
    topic: str = setting(
        "fruit",
        title="Topic",
        description="The first levels of every topic; the station's name and the kind of event follow.",
        pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$",
        max_length=100,
    )
    user: str | None = setting(None, title="User", description="Null for none.", max_length=100)
    password_file: File | None = setting(
        None,
        title="Password's file",
        description="File whose first line is the password, readable by the station's user alone; null takes "
        "MQTT_PASSWORD of the environment, or none.",
    )
    tls: bool = setting(default=False, title="TLS", description="Whether the broker is reached over TLS.")
    authority: File | None = setting(
        None,
        title="Broker's authority",
        description="PEM file of the authority that signs the broker's certificate; null takes the system's.",
    )


class OutboxSettings(Settings):
    """Publishers to other systems. The station never waits for these: undelivered messages are sent later, in order."""

    station: str = setting(
        "station-1",
        title="Station's name",
        description="Name of this station in other systems and on lots' reports; every station needs a different one.",
        pattern=r"^[A-Za-z0-9_.-]{1,64}$",
    )
    longest_pause_s: float = setting(
        60.0,
        title="Longest pause",
        description="Between two tries to reach another system; the first pauses are shorter.",
        unit="s",
        ge=0.1,
        le=3600.0,
    )
    alarm_after_s: float = setting(
        900.0,
        title="Alarm after",
        description="An alarm is raised if an entry has not been delivered to another system for so long.",
        unit="s",
        ge=1.0,
        le=86_400.0 * 7,
    )
    alarm_after_rows: int = setting(
        5000,
        title="Alarm after entries",
        description="Likewise if so many entries wait for delivery, however young they are.",
        ge=1,
        le=100_000_000,
    )
    postgresql: OutboxPostgresqlSettings = setting(
        OutboxPostgresqlSettings(), title="PostgreSQL", description="The database of many stations."
    )
    mqtt: OutboxMqttSettings = setting(OutboxMqttSettings(), title="MQTT", description="The events, published.")

    @model_validator(mode="after")
    def _has_a_user(self) -> "OutboxSettings":
        if self.mqtt.password_file is not None and self.mqtt.user is None:
            raise FieldError([((), messages.PASSWORD_WITHOUT_USER())])
        return self
