"""Rows of the audit trail as sentences: who, what, what changed, and why not."""

import ast
import json
import re
from dataclasses import replace
from typing import get_args

import pytest

from hmi.history.audit_sentences import sentence
from hmi.web.folders import HMI
from hmi.web.text import texts
from hmi.web.translation import Locale
from station.channel.line import CommandName
from station.channel.panel_run import OperatorCommandName, PersonNoted
from station.recipe_store.revision import Origin
from station.records.audit import AuditRow
from station.runtime.observability.audit_logger import AlarmChange
from station.runtime.production.operator_commands import _COMMANDS

FRUIT = {2: "Blueberry", 7: "Elsanta"}


def row(action, subject="station", who="Ida", role="quality", reason="", old=None, new=None):
    before, after = (None if value is None else json.dumps(value) for value in (old, new))
    return AuditRow(1, 1, who, role, action, subject, reason, before, after, "", "")


@pytest.mark.parametrize(("number", "named"), [(2, "Heidelbeere"), (7, "Elsanta"), (9, "9")])
def test_a_change_of_fruit_names_the_fruit(number, named):
    changed = row("command.change_recipe", who="plc", role="plc", old={"recipe": [1, "strawberry", "1"]},
                  new={"argument": number, "done": True, "why": ""})  # fmt: skip
    written = sentence(changed, FRUIT, Locale("de"))
    assert written == ("SPS", f"Hat die Frucht auf {named} gewechselt.", ("recipe: 1, strawberry, 1",))


def test_what_was_refused_says_why():
    refused = row("command.set_mode", old={"mode": 1}, new={"argument": 3, "done": False, "why": "the arm moves"})
    written = sentence(refused, FRUIT, Locale("en"))
    assert written == ("Ida, Quality", "Set the mode 3.", ("Not done: the arm moves", "mode: 1"))


def test_an_alarm_has_its_own_name_in_the_readers_language():
    assert "Greifer" in sentence(row("alarm.shelved", "alarm gripper_link_lost"), {}, Locale("de")).what


@pytest.mark.parametrize(
    ("kind", "named"), [("calibration", "eine Kalibrierung"), ("verification", "eine Überprüfung")]
)
def test_a_run_with_the_ball_is_named_in_the_readers_language(kind, named):
    text = sentence(row("calibration.begun", kind), {}, Locale("de")).what
    assert named in text
    assert kind not in text


def test_a_changed_limit_is_shown_and_fingerprints_are_not():
    approved = row("recipe.approved", "recipe strawberry revision 2", old={"sha256": "ab", "revision": 1},
                   new={"sha256": "cd", "revision": 2, "changes": "area: 98 → 85"})  # fmt: skip
    assert sentence(approved, {}, Locale("en")).what == "Approved the recipe strawberry revision 2."
    assert "strawberry Revision 2 " in sentence(approved, {}, Locale("de")).what
    assert sentence(approved, {}, Locale("en")).details == ("revision: 1 → 2", "changes: area: 98 → 85")


def test_a_row_of_another_version_or_with_shortened_values_is_shown_all_the_same():
    cut = replace(row("press.polished", "jaws"), new='{"text": "# a rec')
    assert sentence(cut, {}, Locale("en")) == ("Ida, Quality", "press.polished: jaws", ())


ENUMERATED = {
    "alarm": get_args(AlarmChange),
    "command": {*CommandName, *OperatorCommandName} - {name for name in _COMMANDS if name not in set(CommandName)},
    "panel": get_args(PersonNoted.model_fields["what"].annotation),
    "recipe": set(Origin) - {Origin.SUBMITTED},
}
"""Actions that the code puts together of two parts; every other one is written in it whole."""
FILES = {"html", "json", "py"}


def test_every_action_of_the_audit_trail_has_a_sentence_and_no_sentence_is_left_over():
    named = {name.removeprefix("audit.") for name in texts() if name.startswith("audit.")}
    named = {name for name in named if "." in name and not name.startswith("role.")}
    whole = re.compile(rf"(?:{'|'.join({name.partition('.')[0] for name in named})})\.[a-z_]+")
    noted = {f"{family}.{each}" for family, names in ENUMERATED.items() for each in names}
    folders = (HMI.parent / "station", HMI / "api")
    for path in (path for folder in folders for path in folder.rglob("*.py") if "messages" not in path.parts):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.Constant(value=str(text)) if whole.fullmatch(text) and text.partition(".")[2] not in FILES:
                    noted.add(text)
                case ast.Call(func=ast.Name(id="AuditEntry"), args=[ast.Starred(), action, *_] | [_, _, action, *_]):
                    if isinstance(action, ast.Constant):
                        noted.add(str(action.value))
                    elif isinstance(action, ast.JoinedStr):
                        assert ast.unparse(action.values[0]).strip("'.") in ENUMERATED, path
    assert noted == named
