"""The cycle's table as a drawing: an arrow for every event that is no disturbance; far ones are named in their box."""

from collections import defaultdict
from html import escape

from station.inspection.cycle import FAULTS, LATCHES, TABLE, UNJUDGED, Event
from station.inspection.states import STATES, State

COLUMN_PX, ROW_PX, WIDTH_PX, HEIGHT_PX, EDGE_PX = 252, 84, 188, 50, 30
COLUMNS: tuple[tuple[str, dict[State, int]], ...] = (
    (
        "getting ready",
        {
            State.UNKNOWN: 0,
            State.CLEARING: 1,
            State.STOPPED: 2,
            State.RESETTING: 3,
            State.HOMING: 4,
            State.CHECKING: 5,
            State.IDLE: 6,
            State.ACCEPTING: 7,
        },
    ),
    (
        "inspecting",
        {
            State.REFERENCE: 0,
            State.APPROACHING: 1,
            State.CLOSING_TO_ONSET: 2,
            State.MOVING: 3,
            State.SETTLING: 4,
            State.CAPTURING: 5,
            State.MEASURING_LAST: 7,
            State.JUDGING: 8,
        },
    ),
    (
        "centring; measuring the step before",
        {
            State.CENTRING: 1,
            State.OPENING_AGAIN: 2,
            State.MOVING_MEASURING: 3,
            State.SETTLING_MEASURING: 4,
            State.CAPTURING_MEASURING: 5,
            State.AWAITING_MEASURE: 6,
            State.AWAITING_MEASURE_LAST: 7,
        },
    ),
    (
        "judged",
        {
            State.RETREATING: 0,
            State.RELEASING: 1,
            State.RECORDING_RELEASE: 2,
            State.RETREATING_ACCEPTED: 3,
            State.RETREATING_ACCEPTING: 4,
            State.RETREATING_READY: 5,
            State.PLACING_ACCEPT: 6,
            State.RECORDING_ACCEPT: 7,
            State.PLACING_REJECT: 8,
            State.RECORDING_REJECT: 9,
        },
    ),
    (
        "failed",
        {
            State.RECORDING_HELD: 0,
            State.OPENING_HELD: 1,
            State.OPENING_UNRECORDED: 3,
            State.HOMING_UNRECORDED: 4,
            State.HELD: 6,
            State.CARRIED: 8,
        },
    ),
    ("stopped for a person", {State.RECORDING_LATCHED: 0, State.LATCHED: 1, State.RECOVERING: 3}),
)
PLACES = {state: (column, row) for column, (_, rows) in enumerate(COLUMNS) for state, row in rows.items()}
DISTURBED = {*FAULTS, *LATCHES, Event.STOP, Event.CALLED_OFF, Event.LATE}
COLOURS = {False: "#dfe7ee", True: "#f3d9d4"}


def diagram() -> str:
    """The drawing, an SVG of fixed text: black on white, readable without colour."""
    arrows = _arrows()
    width, height = len(COLUMNS) * COLUMN_PX + EDGE_PX, 10 * ROW_PX + 20
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif">',
        '<marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">',
        '<path d="M0 0L8 4L0 8z"/></marker>',
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        *(_text(_left(column) + WIDTH_PX / 2, 18, title, 12, "#555") for column, (title, _) in enumerate(COLUMNS)),
        *(_box(state, arrows) for state in PLACES),
        *(_arrow(start, end, events) for (start, end), events in arrows.items() if _near(start, end)),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _arrows() -> dict[tuple[State, State], list[Event]]:
    """The events of an undisturbed cycle, by where they lead from and to."""
    arrows: dict[tuple[State, State], list[Event]] = defaultdict(list)
    for (state, event), transition in TABLE.items():
        if event not in DISTURBED and transition.state != state:
            arrows[state, transition.state].append(event)
    return arrows


def _left(column: int) -> float:
    return EDGE_PX + column * COLUMN_PX


def _top(row: int) -> float:
    return 34.0 + row * ROW_PX


def _near(start: State, end: State) -> bool:
    """Return whether an arrow is short enough to be followed: within a column, or to an adjacent box."""
    (column, row), (to_column, to_row) = PLACES[start], PLACES[end]
    return column == to_column or (abs(column - to_column) == 1 and abs(row - to_row) < 2)


def _box(state: State, arrows: dict[tuple[State, State], list[Event]]) -> str:
    column, row = PLACES[state]
    left, top = _left(column), _top(row)
    stroke = 3 if state in UNJUDGED else 1
    far = [(end, events) for (start, end), events in arrows.items() if start == state and not _near(start, end)]
    return "".join(
        [
            f'<rect x="{left:g}" y="{top:g}" width="{WIDTH_PX}" height="{HEIGHT_PX}" rx="5" stroke="#222" ',
            f'stroke-width="{stroke}" fill="{COLOURS[STATES[state].needs_person]}"/>',
            _text(left + WIDTH_PX / 2, top + (17 if far else 29), _labels(state), 12, "#000"),
            *(
                _text(left + WIDTH_PX / 2, top + 31 + 12 * line, f"{_labels(*events)} → {_labels(end)}", 10, "#333")
                for line, (end, events) in enumerate(far)
            ),
        ]
    )


def _labels(*names: State | Event) -> str:
    return ", ".join(name.value.replace("_", " ") for name in names)


def _arrow(start: State, end: State, events: list[Event]) -> str:
    """A line from border to border, bent where it would cross boxes of its own column."""
    (column, row), (to_column, to_row) = PLACES[start], PLACES[end]
    x1, x2 = _left(column) + WIDTH_PX / 2, _left(to_column) + WIDTH_PX / 2
    y1, y2 = _top(row) + HEIGHT_PX / 2, _top(to_row) + HEIGHT_PX / 2
    if column == to_column and abs(row - to_row) == 1:
        down = to_row > row
        y1, y2 = (y1 + HEIGHT_PX / 2, y2 - HEIGHT_PX / 2) if down else (y1 - HEIGHT_PX / 2, y2 + HEIGHT_PX / 2)
        path, label = f"M{x1:g} {y1:g}L{x2:g} {y2:g}", (x1, (y1 + y2) / 2 + 4)
    elif column == to_column:
        x1, bend = _left(column), _left(column) - 24
        path, label = f"M{x1:g} {y1:g}C{bend:g} {y1:g} {bend:g} {y2:g} {x1:g} {y2:g}", (bend + 4, (y1 + y2) / 2 + 4)
    else:
        right = to_column > column
        x1, x2 = (x1 + WIDTH_PX / 2, x2 - WIDTH_PX / 2) if right else (x1 - WIDTH_PX / 2, x2 + WIDTH_PX / 2)
        # Apart, so that arrows of both directions do not cover each other.
        shift = 9 if right else -9
        y1, y2 = y1 + shift, y2 + shift
        middle = (x1 + x2) / 2
        path, label = f"M{x1:g} {y1:g}C{middle:g} {y1:g} {middle:g} {y2:g} {x2:g} {y2:g}", (middle, (y1 + y2) / 2 - 3)
    return f'<path d="{path}" fill="none" stroke="#444" marker-end="url(#tip)"/>' + _text(
        *label, _labels(*events), 10, "#333"
    )


def _text(x: float, y: float, words: str, size: int, colour: str) -> str:
    halo = 'paint-order="stroke" stroke="#fff" stroke-width="3" ' if size < 12 else ""
    place = f'x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="middle"'
    return f'<text {place} {halo}fill="{colour}">{escape(words)}</text>'
