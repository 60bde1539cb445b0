"""Log lines for machines and for people."""

import asyncio
import io
import json
import logging
from typing import Literal

import pytest
import structlog

from station.channel.line import Reason
from station.devices.gripper.errors import GripperFaultError
from station.logs import configure_logging, inspecting
from station.messages import gripper as messages
from station.messages.message import Message, verbatim
from station.runtime.observability.log_line import log_fruit


@pytest.fixture
def logged():
    """Log to a text of the test's own, and put everything back."""
    root = logging.getLogger()
    before, level = list(root.handlers), root.level
    stream = io.StringIO()

    def start(style: Literal["json", "human"] = "json", **options):
        configure_logging("station", style, stream=stream, **options)
        return stream

    yield start
    for handler in set(root.handlers) - set(before):
        root.removeHandler(handler)
    root.setLevel(level)
    structlog.reset_defaults()


def lines(stream):
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_each_line_is_json_with_event_time_process_and_inspection(logged):
    stream = logged()
    with inspecting(4711):
        structlog.get_logger("cycle").info("fruit_judged", outcome="PASS", area_mm2=3.5)
        logging.getLogger("uvicorn.error").info("chatter")
        logging.getLogger("station.x").warning("in %d words", 3, extra={"who": "me"})
    logging.getLogger("station.x").warning("after")
    first, second, third = lines(stream)
    assert first["event"] == "fruit_judged"
    assert (first["outcome"], first["area_mm2"], first["sequence"], first["process"]) == ("PASS", 3.5, 4711, "station")
    assert first["time"].endswith("Z")
    assert (second["event"], second["who"], second["sequence"], second["level"]) == (
        "in 3 words",
        "me",
        4711,
        "warning",
    )
    assert "sequence" not in third


def test_a_task_begun_inside_keeps_the_inspection(logged):
    stream = logged()

    async def one(sequence):
        with inspecting(sequence):
            await asyncio.gather(*(asyncio.create_task(deeper(sequence)) for _ in range(2)))

    async def deeper(sequence):
        await asyncio.sleep(0)
        structlog.get_logger("x").info("deeper", wanted=sequence)

    async def both():
        await asyncio.gather(one(1), one(2))

    asyncio.run(both())
    assert len(lines(stream)) == 4
    assert all(line["sequence"] == line["wanted"] for line in lines(stream))


def test_secrets_are_hidden_in_fields_and_in_tracebacks(logged):
    stream = logged()

    def fails(password):
        raise RuntimeError("no access")

    structlog.get_logger("x").info("login", api_key="hunter2", user="ann", pin="hunter2", spinning=1)
    logging.getLogger("y").warning("login", extra={"token": "hunter2"})
    try:
        fails("hunter" + "2")
    except RuntimeError:
        logging.getLogger("y").exception("failed")
    assert "hunter2" not in stream.getvalue()
    login, _, failed = lines(stream)
    assert (login["user"], login["spinning"], login["api_key"]) == ("ann", 1, "(hidden)")
    assert "RuntimeError: no access" in failed["exception"]


def test_an_error_of_the_grippers_is_logged_with_its_id_and_its_parameters(logged):
    stream = logged()
    error = GripperFaultError(0xA)
    logging.getLogger("station.x").warning("%s: %s", "gripper 100 %", error.message)
    logging.getLogger("station.x").warning("gripper", extra={"fault": error})
    structlog.get_logger("x").warning("gripper: %s", error)
    logging.getLogger("station.x").warning("%s, %s", error.message, messages.NOT_ACTIVE())
    logging.getLogger("station.x").warning("%(what)s", {"what": error})
    written, field, structured, both, mapped = lines(stream)
    for line in (written, field, structured, mapped):
        assert line["message"] == messages.FAULT.id
        assert line["parameters"]["cause"]["parameters"]["name"] == "under_voltage"
        assert line["parameters"]["remedy"] == {"id": messages.REMEDY_UNDER_VOLTAGE.id, "parameters": {}}
    assert written["event"] == f"gripper 100 %: {error}"
    assert field["fault"] == str(error)
    assert structured["event"] == f"gripper: {error}"
    assert [each["id"] for each in both["parameters"]["sentences"]] == [messages.FAULT.id, messages.NOT_ACTIVE.id]
    assert Message.model_validate_json(json.dumps({"id": written["message"], "parameters": written["parameters"]})) == (
        error.message
    )


def test_a_person_reads_the_sentence_alone(logged):
    stream = logged("human")
    error = GripperFaultError(0xA)
    logging.getLogger("station.x").warning("gripper: %s", error.message)
    (line,) = stream.getvalue().splitlines()
    assert str(error) in line
    assert messages.FAULT.id not in line


def test_a_second_configuration_replaces_the_first(logged):
    logged()
    stream = logged(level="WARNING")
    structlog.get_logger("x").info("quiet")
    logging.getLogger("y").warning("once")
    assert [line["event"] for line in lines(stream)] == ["once"]


def test_lines_for_a_person(logged):
    stream = logged("human")
    with inspecting(7):
        structlog.get_logger("x").info("fruit_judged", outcome="PASS")
    (line,) = stream.getvalue().splitlines()
    assert "fruit_judged" in line
    assert "sequence=7" in line
    assert not line.startswith("{")


def test_one_line_a_fruit(outcome, caplog):
    log, areas = logging.getLogger("fruit"), [0.0, 10.0, None, 31.5]
    caplog.set_level(logging.INFO)
    log_fruit(log, outcome, "strawberry", (), areas)
    late = {"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True, "area_mm2": None, "closing_mm": None}
    why = (verbatim("The deadline of 8 s was over."), verbatim("Nothing was measured."))
    log_fruit(log, outcome.model_copy(update=late), "", why, [])
    log_fruit(log, outcome.model_copy(update=late), "", (), [])
    begins = "fruit 4711  trigger 12  no recipe  -  NO_RESULT  no area  3.21 s  late"
    assert caplog.messages == [
        "fruit 4711  trigger 12  strawberry  ▁▃·█  PASS  31.5 mm² at 4.0 mm  3.21 s",
        f"{begins}  The deadline of 8 s was over. Nothing was measured.",
        f"{begins}  late",
    ]
