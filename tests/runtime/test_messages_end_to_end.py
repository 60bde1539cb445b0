"""Messages end to end: four troubles on the page in German, in the API, in the log, and in the records."""

import asyncio
import contextlib
import html
import io
import json
import logging
import re
import shutil
import urllib.request
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import structlog
from click.testing import CliRunner

from hmi.api.tokens import ApiTokens
from hmi.web.app import make_app, make_context
from hmi.web.roles import Role
from hmi.web.translation import Locale, translations
from station.channel.line import CommandName, Outcome
from station.cli import cli
from station.inspection.alarm_table import AlarmId
from station.inspection.states import State
from station.logs import configure_logging
from station.messages import commands, recipes, records, settings
from station.messages.message import VERBATIM, Message, definitions
from station.messages.reasons import reason_message
from station.serving.guard import Limits
from station.serving.server import Server, listen
from station.settings.configuration import Configuration
from station.vocabulary import Reason, Refusal

NUMBER = 2
"""The blueberry's, in the line's commands."""
SHARED = {each.id for each in definitions() if not re.search(r"[a-z]", re.sub(r"\{\w+\}", "", each.english))}
"""Ids without a text of their own."""


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    """The log of this process as JSON lines; afterwards logging is as before."""
    root = logging.getLogger()
    before, level = list(root.handlers), root.level
    stream = io.StringIO()
    configure_logging("station", "json", stream=stream)
    yield stream
    for handler in set(root.handlers) - set(before):
        root.removeHandler(handler)
    root.setLevel(level)
    structlog.reset_defaults()


@dataclass
class Pages:
    """The pages' server, and a viewer's token for the API."""

    address: str
    token: str

    async def get(self, path: str) -> str:
        """Return an answer's text, in German."""
        headers = {"Accept-Language": "de", "Authorization": f"Bearer {self.token}"}
        request = urllib.request.Request(self.address + path, headers=headers)

        def read() -> str:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return answer.read().decode()

        return await asyncio.to_thread(read)

    async def text(self, path: str) -> str:
        """Return a page's text without its markup."""
        return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", "", await self.get(path))))

    async def alarm(self, alarm: AlarmId) -> dict[str, Any] | None:
        """Return an alarm as the API has it, None for one in its normal state."""
        found = json.loads(await self.get("/api/v1/alarms"))["alarms"]
        return next((each for each in found if each["alarm"] == alarm), None)


@contextlib.asynccontextmanager
async def served(site: Configuration) -> AsyncIterator[Pages]:
    """Serve the pages of a station."""
    token = ApiTokens(site.home / "hmi").add("test", Role.VIEWER)
    listener = listen("127.0.0.1", 0, "hmi", "the pages", Limits(most=100, per_address=100, reserve=100))
    server = Server(listener, make_app(make_context(site, None, "")))
    serving = asyncio.create_task(server.run_until_exit(), name="pages")
    try:
        yield Pages(f"http://127.0.0.1:{listener.getsockname()[1]}", token)
    finally:
        server.should_exit = True
        await serving
        listener.close()


def read(data: dict[str, Any]) -> Message:
    """Read a message of the API's."""
    return Message.model_validate_json(json.dumps({name: data[name] for name in ("id", "parameters")}))


def german(message: Message) -> str:
    """Write a message in German; each part of it has a translation."""
    assert set(message.ids()) <= translations("de").keys() | SHARED
    written = Locale("de").sentence(message)
    assert written != str(message)
    return html.unescape(re.sub(r"<[^>]+>", "", written))


async def proven(alarm: AlarmId, pages: Pages, log: io.StringIO) -> Message:
    """Check an alarm in the API, on the page and in the log; a device that fails again has another detail then.

    Returns:
        The detail.
    """
    texts: dict[str, Message] = {}
    page = ""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(60):
            while not texts or not all(german(each) in page for each in texts.values()):
                if data := await pages.alarm(alarm):
                    texts = {part: read(data[part]) for part in ("cause", "consequence", "action", "detail")}
                    assert data["detail"]["text"] == str(texts["detail"])
                    page = await pages.text(f"/alarms/{alarm}")
                await asyncio.sleep(0.05)
    assert [part for part, each in texts.items() if german(each) not in page] == [], page
    assert texts["cause"].id == f"alarm.cause.{alarm}"

    raised = [line for line in map(json.loads, log.getvalue().splitlines()) if f"alarm {alarm} raised" in line["event"]]
    fields = texts["detail"].model_dump(mode="json")
    assert (fields["id"], fields["parameters"]) in [(line["message"], line["parameters"]) for line in raised]
    assert str(texts["detail"]) in [line["event"].partition(": ")[2] for line in raised]
    return texts["detail"]


async def remembered(outcome: Outcome, message: Message, pages: Pages, file: Path) -> None:
    """Check that an inspection's record has what ended it, in the API, on its page and at the command line."""
    data = json.loads(await pages.get(f"/api/v1/inspections/{outcome.sequence}"))
    explanation = [read(each) for each in data["messages"]]
    assert message.id in {each.id for each in explanation}
    page = await pages.text(f"/history/{outcome.sequence}")
    assert [each for each in explanation if german(each) not in page] == []

    command = ["records", "show", str(outcome.sequence), "--config", str(file)]
    shown = await asyncio.to_thread(CliRunner().invoke, cli, command)
    assert [str(each) for each in explanation if str(each) not in shown.output] == [], shown.output
    assert [reason for reason in outcome.reasons if f"{reason}: {reason_message(reason)}" not in shown.output] == []


async def fail(cell: Any, device: str, fault: str) -> Outcome:
    """Switch a device's fault on in the middle of an inspection, and return its outcome."""
    await cell.line.ready()
    cell.at(State.SETTLING, lambda: cell.twin.boards[device].set(fault))
    reply = await cell.line.begin()
    return await cell.line.outcome(reply.sequence)


@pytest.mark.timeout(240)
def test_a_refused_recipe_a_full_disk_and_a_jam_are_the_same_messages_everywhere(
    bench, log, tmp_path, settings_file, monkeypatch
):
    file, free_mb = settings_file(), 9000.0
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**10, 0, int(free_mb * 1e6)))

    async def scenario() -> None:
        nonlocal free_mb
        async with bench(file) as cell, served(cell.configuration) as pages:
            await cell.choose("blueberry")
            recipe = tmp_path / "recipes" / "raspberry.yaml"
            recipe.write_text(json.dumps({**json.loads(recipe.read_text()), "plc_number": "three"}))
            refused = await proven(AlarmId.RECIPE_BROKEN, pages, log)
            assert recipes.FILE_BROKEN.id in refused.ids()
            assert list(refused.ids()).count(settings.PROBLEM.id) == 1
            assert VERBATIM.id not in refused.ids()
            assert "erwartet: eine ganze Zahl von 1 bis 65535, gefunden: 'three'" in german(refused)
            done = await cell.line.order(CommandName.CHANGE_RECIPE, 9)
            assert commands.RECIPE_UNKNOWN.id in done.why.ids()
            assert re.search(r"\b9\b", german(done.why))

            await cell.line.ready()
            free_mb = 0.5
            assert (await cell.line.begin()).refusal is Refusal.RECORDS_FULL
            full = await proven(AlarmId.RECORDS_NOT_WRITABLE, pages, log)
            assert records.RESERVE_REACHED.id in full.ids()
            free_mb = 9000.0

            outcome = await fail(cell, "gripper", "stuck")
            jam = await proven(AlarmId.GRIPPER_JAM, pages, log)
            assert Reason.GRIPPER_FAULT in outcome.reasons
            await remembered(outcome, jam, pages, file)
            await cell.line.publish(outcome)
            cell.twin.boards["gripper"].clear()

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_lost_arm_is_the_same_message_everywhere(bench, log, settings_file):
    file = settings_file(bench=False)

    async def scenario() -> None:
        async with bench(file) as cell, served(cell.configuration) as pages:
            assert (await cell.line.order(CommandName.CHANGE_RECIPE, NUMBER)).done
            cell.lay("blueberry")
            outcome = await fail(cell, "arm", "link_cut")
            lost = await proven(AlarmId.ARM_LINK_LOST, pages, log)
            assert Reason.ARM_FAULT in outcome.reasons
            await remembered(outcome, lost, pages, file)
            await cell.line.publish(outcome)
            cell.twin.boards["arm"].clear()

    asyncio.run(scenario())
