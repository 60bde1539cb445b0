"""The diagram of a trigger's way names what the channel and the cycle really have."""

import re
from pathlib import Path

from station.channel import line
from station.channel.messages import ChannelMessage
from station.inspection.cycle import Action

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "station.md"


def test_the_triggers_way_has_every_message_of_an_inspection_and_only_real_actions():
    diagram = DOCUMENT.read_text("utf-8").split("sequenceDiagram")[1].split("```")[0]
    between = re.findall(r"[IS]--?>>[IS]: ([A-Z][A-Za-z]+)", diagram)
    messages = [name for name in between if not name.isupper()]
    assert sorted(messages) == sorted(["Begin", "BeginReply", "AwaitOutcome", "Outcome", "Published", "Acknowledged"])
    assert all(issubclass(getattr(line, name), ChannelMessage) for name in messages)
    actions = re.findall(r"\b[A-Z][A-Z_]{4,}\b", diagram)
    assert actions
    assert {action.name for action in Action}.issuperset(actions)
