"""Generator of files from the conduits: `python -m station.settings.network_export`, in a checkout.

The table and the drawing of docs/network.md, and the rules of an example site; a test compares them.
"""

import textwrap
from html import escape
from pathlib import Path

from station.settings.conduits import MEANING, Conduit, Zone, conduits
from station.settings.configuration import Configuration
from station.settings.firewall import rules

ROOT = Path(__file__).resolve().parents[2]
BEGIN, END = "<!-- conduits: made by python -m station.settings.network_export -->\n", "<!-- end of conduits -->\n"
EXAMPLE = {
    Zone.CELL: ("192.168.56.0/24",),
    Zone.LINE: ("10.10.20.0/24",),
    Zone.OPERATORS: ("10.10.30.0/24",),
    Zone.MONITORING: ("10.10.40.2",),
    Zone.ARCHIVE: ("10.10.40.3",),
}
MAINTENANCE = ("10.10.50.0/28",)
PLC = "10.10.20.5"
_BOX_WIDTH, _BOX_HEIGHT, _GAP = 250, 104, 26
_LEFT, _MIDDLE, _RIGHT, _WIDTH = 20, 460, 900, 1170
_SIDES = {_LEFT: (Zone.CELL, Zone.LINE), _RIGHT: (Zone.OPERATORS, Zone.MONITORING, Zone.ARCHIVE)}


def example_site() -> Configuration:
    """Return the example configuration of the document."""
    return Configuration.model_validate(
        {
            "home": Path("/var/lib/fruit-station"),
            "modbus": {"host": "10.10.20.10", "port": 502, "readers": ("10.10.20.0/24",), "writers": (PLC,)},
            "hmi": {"host": "10.10.30.10", "names": ("station-7.example",)},
            "metrics": {"host": "10.10.40.10"},
            "arm": {"host": "192.168.56.10"},
            "gripper": {"urcap": {"host": "192.168.56.10"}},
            "camera": {"driver": "digit"},
            "outbox": {"postgresql": {"enabled": True, "host": "10.10.40.3"}},
        }
    )


def exported(root: Path = ROOT) -> dict[Path, str]:
    """Return the content of each file of the checkout; the document's text around the table is retained."""
    guide = root / "docs" / "network.md"
    before, _, rest = guide.read_text(encoding="utf-8").partition(BEGIN)
    return {
        guide: f"{before}{BEGIN}{table(conduits(Configuration()))}{END}{rest.partition(END)[2]}",
        root / "docs" / "network.svg": drawing(conduits(Configuration())),
        root / "deploy" / "nftables.conf": rules(example_site(), EXAMPLE, MAINTENANCE),
    }


def table(listed: tuple[Conduit, ...]) -> str:
    """Return the conduits as a Markdown table."""
    rows = ["| from | to | protocol | default | set by | carries | protected by |", "|" + " --- |" * 7]
    rows += [
        f"| {each.source} | {each.target} | {each.protocol} | {each.host}:{each.port}{_closed(each)} "
        f"| `{each.setting}` | {each.carries} | {each.protected} |"
        for each in listed
    ]
    return "\n".join(rows) + "\n"


def _closed(conduit: Conduit) -> str:
    return "" if conduit.enabled else ", closed"


def drawing(listed: tuple[Conduit, ...]) -> str:
    """Return the zones with their conduits as an SVG: black on white, readable without colour."""
    height = 3 * (_BOX_HEIGHT + _GAP) + _GAP
    places = {
        zone: (x, _GAP + (height - _GAP) / len(zones) * index + ((height - _GAP) / len(zones) - _BOX_HEIGHT - _GAP) / 2)
        for x, zones in _SIDES.items()
        for index, zone in enumerate(zones)
    }
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" font-family="sans-serif">',
        '<marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">',
        '<path d="M0 0L8 4L0 8z"/></marker>',
        f'<rect width="{_WIDTH}" height="{height}" fill="#fff"/>',
        _box(Zone.STATION, _MIDDLE, _GAP, height - 2 * _GAP, thick=True),
        *(_box(zone, x, y, _BOX_HEIGHT) for zone, (x, y) in places.items()),
        *(_arrows(zone, *places[zone], [each for each in listed if zone in each[:2]]) for zone in places),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _box(zone: Zone, x: float, y: float, height: float, *, thick: bool = False) -> str:
    lines = textwrap.wrap(MEANING[zone], 37, break_on_hyphens=False)
    middle = x + _BOX_WIDTH / 2
    return "".join(
        [
            f'<rect x="{x:g}" y="{y:g}" width="{_BOX_WIDTH}" height="{height:g}" rx="6" fill="#eef2f5" stroke="#222" ',
            f'stroke-width="{3 if thick else 1}"/>',
            _text(middle, y + 26, zone.value, 16, "middle"),
            *(_text(middle, y + 50 + 16 * line, text, 12, "middle") for line, text in enumerate(lines)),
        ]
    )


def _arrows(zone: Zone, x: float, y: float, listed: list[Conduit]) -> str:
    """Return arrows from the opening to the listening zone, one for each direction, with its ports."""
    near, far = (x + _BOX_WIDTH, _MIDDLE) if x < _MIDDLE else (x, _MIDDLE + _BOX_WIDTH)
    groups = [
        (near, far, [each for each in listed if each.source is zone]),
        (far, near, [each for each in listed if each.target is zone]),
    ]
    drawn, line_y = "", y + 22
    for start, end, group in groups:
        if not group:
            continue
        line = f"M{start:g} {line_y:g}L{end:g} {line_y:g}"
        drawn += f'<path d="{line}" stroke="#222" stroke-width="2" marker-end="url(#tip)"/>'
        for number, each in enumerate(group):
            name = f"{each.protocol}  {each.port}"
            drawn += _text((start + end) / 2, line_y + 15 + 15 * number, name, 11, "middle")
        line_y += 15 * len(group) + 24
    return drawn


def _text(x: float, y: float, text: str, size: int, anchor: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{anchor}">{escape(text)}</text>'


def main() -> None:
    """Write every file that is made from the conduits."""
    for path, text in exported().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
