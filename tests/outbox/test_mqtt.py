"""The same events through a real broker: plain JSON, in order, at least once, and none missing after it was away."""

import asyncio
import json
import logging
import re
from typing import Any

import aiomqtt
import pytest

from station.outbox.errors import OutboxError
from station.outbox.feed import Batch, Origin
from station.outbox.mqtt import Mqtt, Session
from station.outbox.publisher import Publisher
from station.settings.outbox import OutboxMqttSettings
from tests.eventually import until

LIMIT_S = 90.0


@pytest.fixture
def mqtt(broker, tmp_path):
    settings = OutboxMqttSettings(
        enabled=True, host="127.0.0.1", port=broker.port, user=broker.user, password_file=broker.password_file
    )
    return Mqtt(settings, "line-7", tmp_path / "outbox")


def listener(broker):
    return aiomqtt.Client(
        "127.0.0.1", broker.port, username=broker.user, password=broker.password, identifier="listener",
        clean_session=False,
    )  # fmt: skip


async def hear(broker, wanted, heard):
    """Gather messages by topic until so many inspections are heard, over the broker's absences too."""
    async with asyncio.timeout(LIMIT_S):
        while True:
            try:
                async with listener(broker) as client:
                    await client.subscribe("fruit/#", qos=1)
                    async for message in client.messages:
                        heard.append((message.topic.value, json.loads(message.payload)))
                        if {data["sequence"] for topic, data in heard if topic.endswith("/inspection")} >= wanted:
                            return
            except aiomqtt.MqttError:
                await asyncio.sleep(0.05)


def test_events_are_published_in_order_and_none_is_missing_after_the_broker_was_away(broker, mqtt, fill, tmp_path):
    records = tmp_path / "records"
    fill(records, 1, 3, steps=1)

    async def steps():
        publisher = Publisher(records, "line-7", mqtt, longest_pause_s=0.5)
        publishing = asyncio.create_task(publisher.run())
        try:
            await until(lambda: publisher.status().waiting == 0, LIMIT_S)  # what was there before is no news
            heard = []
            listening = asyncio.create_task(hear(broker, set(range(4, 61)), heard))
            await until(lambda: ("fruit/line-7/online", True) in heard, LIMIT_S)
            await asyncio.to_thread(fill, records, 4, 20, 1)
            await until(lambda: len(heard) > 10 and publisher.status().waiting == 0, LIMIT_S)
            broker.stop()
            await until(lambda: not publisher.status().connected, LIMIT_S)
            await asyncio.to_thread(fill, records, 21, 60, 1)
            broker.start()
            await listening
        finally:
            publishing.cancel()
            await asyncio.gather(publishing, return_exceptions=True)
        inspections = [data for topic, data in heard if topic == "fruit/line-7/inspection"]
        first = list(dict.fromkeys(data["sequence"] for data in inspections))
        assert first == list(range(4, 61)), "each in order when it is heard first"
        by_id = {data["id"]: data["sequence"] for data in inspections}
        assert len(by_id) == 57, "one heard twice has the same id both times"
        assert inspections[0]["outcome"] in {"PASS", "FAIL", "NO_RESULT"}
        assert inspections[0]["curve"][0]["width_mm"] == 30.0
        assert inspections[0]["began"] == "2026-01-01T00:00:12.000+00:00"

    asyncio.run(steps())


def test_a_wrong_password_is_said_without_it(broker, mqtt, caplog):
    broker.password_file.write_text("quite wrong\n")

    async def steps():
        async with mqtt.connected():
            pass

    with caplog.at_level(logging.DEBUG), pytest.raises(OutboxError, match=r"(?i)not authori[sz]ed") as caught:
        asyncio.run(steps())
    assert "quite wrong" not in str(caught.value) + caplog.text


def test_a_password_that_others_can_read_is_refused(broker, mqtt):
    broker.password_file.chmod(0o644)

    async def steps():
        async with mqtt.connected():
            pass

    with pytest.raises(OutboxError, match=re.escape(f"chmod 600 {broker.password_file}")):
        asyncio.run(steps())


def test_after_a_loss_of_the_records_and_a_restore_no_history_is_published_again(tmp_path):
    def lineage(*origins, last):
        return Batch(tuple(Origin(*origin) for origin in origins), (), last, last, None)

    no_broker: Any = None

    async def publish(batch):
        """As one connection does."""
        session = Session(no_broker, "fruit/line-7", tmp_path / "outbox" / "mqtt.json")
        position = await session.position(batch)
        await session.publish(batch)
        return position

    async def steps():
        assert await publish(lineage(("A", None), last=5000)) == 5000, "history is not published at the first start"
        assert await publish(lineage(("X", None), last=40)) == 0, "started anew after a loss: nothing of it is omitted"
        restored = lineage(("C", None), ("A", 4000), last=4001)
        assert await publish(restored) == 4000, "a backup of the lost records, which were published up to here"
        assert await publish(lineage(("C", None), ("A", 4000), last=4010)) == 4001

    asyncio.run(steps())
