"""Write what is made from the domain's tables: `python -m station.inspection.export`, in a checkout.

The documents of the cycle and of the alarms with the cycle's drawing; a test compares them.
"""

from collections.abc import Iterable
from pathlib import Path

from station.inspection.alarm_table import ALARMS, PRIORITIES, AlarmId, Priority, heading
from station.inspection.alarms import (
    CHATTER_RAISES,
    CHATTER_S,
    LATCHED_LIFE,
    LIFE,
    LONGEST_SHELVED_S,
    AlarmEvent,
    AlarmState,
)
from station.inspection.cycle import LATCHES, REASONS, START, TABLE, Act, Event, Raise
from station.inspection.diagram import diagram
from station.inspection.states import STATES, State
from station.messages import states

ROOT = Path(__file__).resolve().parents[2]
MADE = "<!-- made by python -m station.inspection.export -->\n"

CYCLE = f"""# The cycle

{MADE}
The station's cycle is one table in `station/inspection/cycle.py`: a state and an event lead to a state and actions.
What it does not list is refused and counted. The service carries the actions out and reports their results as events.

![The cycle](cycle.svg)

The drawing leaves the disturbances out; the table below has them. A thick frame: an inspection that is not judged yet,
which ends as NO_RESULT when it is disturbed. Red: only a person can continue from here. Where the arm or the gripper
fails, the station waits in `held` until it was read again.

What tests prove by walking through everything that the table can lead to, with a crash at any moment:

- an accepted trigger has exactly one outcome, and the outcome is durable before it is published;
- after a grip the arm does not move before the jaws are open, but to carry a judged fruit to its place;
- nothing moves in a safety stop, and only a person's confirmation ends one;
- after a fault nothing moves before every device was read;
- from everywhere there is a way back to `idle`; where it needs a person, the state says so;
- no row of the table is dead.
"""
ALARM = f"""# Alarms

{MADE}
An alarm requires an operator's action (ISA-18.2). Its number is the PLC's error code, and its bit is set while it is
active: bit number - 1 of the register `alarms`, or for the numbers from 33 on bit number - 33 of `alarms_33_to_64`.
"""


def exported(root: Path = ROOT) -> dict[Path, str]:
    """Return the content of each exported file."""
    documents = root / "docs"
    return {
        documents / "cycle.md": cycle_document(),
        documents / "cycle.svg": diagram(),
        documents / "alarms.md": alarms_document(),
    }


def cycle_document() -> str:
    """The cycle's states and its whole table."""
    parts = [
        CYCLE,
        "## States\n",
        (
            "In the states that refuse a trigger as `busy`, the text ends with: "
            f"{states.WAIT()} Where *may end* says yes, no inspection is under way and the process may end.\n"
        ),
        _table(("state", "PackML", "refuses a trigger as", "says", "may end"), map(_state, STATES)),
        "## Table\n",
        (
            f"It begins in `{START.state}` with {_acts(START.actions)}. What has the same effect shares a row; where "
            "the state stays as it is, no next state is named. *Its alarm* is in the last table.\n"
        ),
        _table(("states", "events", "next", "actions"), _transitions()),
        "## Reasons and alarms of the disturbances\n",
        "An inspection that an event closes as NO_RESULT has the event's reason.\n",
        _table(
            ("event", "reason", "its alarm"),
            (
                (f"`{event}`", f"`{reason}`", _alarm_link(LATCHES[event]) if event in LATCHES else "")
                for event, reason in REASONS.items()
            ),
        ),
    ]
    return "\n".join(parts)


def alarms_document() -> str:
    """Every alarm, and the life of one."""
    parts = [
        ALARM,
        _table(
            ("number", "alarm", "priority"),
            ((str(row.number), f"[`{alarm}`](#{heading(alarm)})", row.priority.value) for alarm, row in ALARMS.items()),
        ),
        _table(("priority", "means", "alarms"), map(_priority, Priority)),
        *(part for alarm in ALARMS for part in _alarm(alarm)),
        "## Life of an alarm\n",
        (
            f"Shelving ends by itself, after {LONGEST_SHELVED_S / 3600:g} h at the latest. An alarm that is raised "
            f"{CHATTER_RAISES} times within {CHATTER_S:g} s is published once, counted, and stays until it has not "
            f"come for {CHATTER_S:g} s. All of it is stored over a restart. `station alarms list` shows alarms that "
            "are not in their normal state; `station alarms acknowledge`, `shelve` and `unshelve` change them, and the "
            "audit trail has who did so.\n"
        ),
        _life(LIFE),
        "Latched alarms are never shelved, and end only when a person has reset them after their cause is gone:\n",
        _life(LATCHED_LIFE),
    ]
    return "\n".join(parts)


def _state(state: State) -> tuple[str, ...]:
    facts = STATES[state]
    trigger = "" if facts.refusal is None else f"`{facts.refusal}`"
    packml = "unknown" if facts.packml is None else facts.packml.value.upper()
    says = str(facts.activity)
    return f"`{state}`", packml, trigger, says, "yes" if facts.may_exit else ""


def _transitions() -> Iterable[tuple[str, ...]]:
    """A row for each effect, those of few states first."""
    places: dict[tuple[Event, State | None, str], list[State]] = {}
    for state, event in sorted(TABLE, key=lambda pair: list(State).index(pair[0])):
        next_, actions = TABLE[state, event]
        effect = (event, None if next_ == state else next_, _acts(actions, LATCHES.get(event)))
        places.setdefault(effect, []).append(state)
    events: dict[tuple[tuple[State, ...], State | None, str], list[Event]] = {}
    for (event, next_, acts), where in places.items():
        events.setdefault((tuple(where), next_, acts), []).append(event)
    for (where, next_, acts), what in sorted(events.items(), key=lambda row: len(row[0][0])):
        yield _code(where), _code(what), "" if next_ is None else f"`{next_}`", acts


def _code(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _acts(actions: Iterable[Act], own: AlarmId | None = None) -> str:
    """Actions in their order; the event's own alarm is not named again."""
    return ", ".join(
        ("its alarm" if action.alarm == own else f"alarm {_alarm_link(action.alarm)}")
        if isinstance(action, Raise)
        else f"`{action}`"
        for action in actions
    )


def _alarm_link(alarm: AlarmId) -> str:
    return f"[`{alarm}`](alarms.md#{heading(alarm)})"


def _priority(priority: Priority) -> tuple[str, ...]:
    return priority.value, PRIORITIES[priority], str(sum(row.priority == priority for row in ALARMS.values()))


def _alarm(alarm: AlarmId) -> Iterable[str]:
    row = ALARMS[alarm]
    yield f"## {alarm.value.replace('_', ' ')}\n"
    yield f"Number {row.number}, {row.priority}{', latched' if row.latched else ''}.\n"
    yield f"- Cause: {row.cause}\n- Consequence: {row.consequence}\n- Action: {row.action}\n"


def _life(life: dict[tuple[AlarmState, AlarmEvent], AlarmState]) -> str:
    return _table(
        ("state", "event", "next"),
        ((f"`{state}`", f"`{event}`", f"`{next_}`") for (state, event), next_ in life.items()),
    )


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, ("---",) * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)


def main() -> None:
    """Write every file that is made from the tables."""
    for path, text in exported().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
