"""MQTT destination: the events as plain JSON, at least once and in order."""

import asyncio
import contextlib
import json
import logging
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

import aiomqtt

from station.atomic_file import write_atomically
from station.messages import outbox as messages
from station.outbox.errors import OutboxError
from station.outbox.feed import Batch, json_text
from station.outbox.secrets import password
from station.settings.outbox import OutboxMqttSettings

log = logging.getLogger(__name__)

NAME = "mqtt"
_TIMEOUT_S = 10
"""Longest wait for the broker's answer, s; an estimate."""
_KEEPALIVE_S = 20
"""Longest silence before the client pings the broker, s; an estimate. After 1.5 times as long the broker publishes the
last will."""
_AT_LEAST_ONCE = 1
"""MQTT's quality of service 1."""


class Mqtt:
    """MQTT publisher. Its folder stores the position: a broker stores none."""

    name = NAME

    def __init__(self, settings: OutboxMqttSettings, station: str, folder: Path) -> None:
        self._settings, self._station, self._folder = settings, station, folder
        self.refused = 0
        """Always 0: a broker takes what it is given."""

    @asynccontextmanager
    async def connected(self) -> AsyncIterator["Session"]:
        """Connect. `TOPIC/STATION/online` is `true` inside the block, then `false`: the broker's last will.

        Raises:
            OutboxError: the broker cannot be reached, or the connection was lost in the block.
        """
        settings = self._settings
        root = f"{settings.topic}/{self._station}"
        online = f"{root}/online"
        try:
            async with aiomqtt.Client(
                settings.host,
                settings.port,
                username=settings.user,
                password=password(settings.password_file, "MQTT_PASSWORD") if settings.user else None,
                identifier=f"fruit-station-{self._station}",
                tls_context=ssl.create_default_context(cafile=settings.authority) if settings.tls else None,
                will=aiomqtt.Will(online, b"false", _AT_LEAST_ONCE, retain=True),
                timeout=_TIMEOUT_S,
                keepalive=_KEEPALIVE_S,
            ) as client:
                await client.publish(online, b"true", _AT_LEAST_ONCE, retain=True)
                yield Session(client, root, self._folder / "mqtt.json")
                await client.publish(online, b"false", _AT_LEAST_ONCE, retain=True)
        except (aiomqtt.MqttError, OSError) as error:
            address = f"{settings.host}:{settings.port}"
            cause = messages.UNREACHABLE(destination="MQTT", address=address, error=str(error))
            raise OutboxError(cause, messages.SEE_SERVER()) from error


class Session:
    """An open connection."""

    def __init__(self, client: aiomqtt.Client, root: str, position: Path) -> None:
        self._client, self._root, self._path = client, root, position
        self._kept: dict[str, int] = {}
        """By origin, also of those that are lost: a backup of one may be restored."""

    async def position(self, batch: Batch) -> int:
        """Return the last entry that was published; at the very first start the newest: history is not published."""
        try:
            self._kept = json.loads(self._path.read_bytes())
        except FileNotFoundError:
            self._keep(batch, batch.last)
            return batch.last
        except (OSError, ValueError) as error:
            log.warning("%s: %s; publishing goes on with what is new", self._path, error)
        known = batch.known(self._kept)
        if known is not None:
            return known
        return 0 if self._kept else batch.last

    async def publish(self, batch: Batch) -> None:
        """Publish the entries after the position, each event after the broker has acknowledged the one before."""
        for event in batch.events:
            now = datetime.now(UTC).isoformat(timespec="milliseconds")
            data = {"id": f"{event.data['station']}/{event.data['origin']}/{event.entry}", "sent": now, **event.data}
            await self._client.publish(f"{self._root}/{event.kind}", json_text(data).encode(), _AT_LEAST_ONCE)
        # After the broker's acknowledgements: where the process ends before, events are repeated and none is lost.
        self._keep(batch, batch.up_to)

    async def idle(self, pause_s: float) -> None:
        """Wait; raises if the broker goes away meanwhile."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(pause_s):
                async for _ in self._client.messages:  # none is subscribed to: it only ends with the connection
                    pass

    def _keep(self, batch: Batch, position: int) -> None:
        self._kept[batch.lineage[0].id] = position
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(self._path, json.dumps(self._kept).encode())
