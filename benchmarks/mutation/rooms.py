"""The pure rooms: modules that are mutated, and the tests of their own that have to find every change."""

from typing import NamedTuple


class Room(NamedTuple):
    """A room of pure code with its tests."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]
    """pytest's arguments."""


ROOMS = {
    "judge": Room(
        ("station.inspection.judge", "station.inspection.evidence", "station.inspection.second_press"),
        (
            "tests/inspection/test_judge.py",
            "tests/inspection/test_evidence.py",
            "tests/inspection/test_second_press.py",
        ),
    ),
    "handshake": Room(
        tuple(
            f"plc_interface.handshake.{name}"
            for name in (
                "bits", "commands", "inputs", "inspection", "link", "machine", "outcomes", "results",
                "resynchronisation", "state", "table", "trigger", "view", "work",
            )
        ),
        ("tests/plc_interface/handshake",),
    ),
    "codec": Room(
        ("plc_interface.registers.codec", "plc_interface.registers.register", "plc_interface.registers.alarms"),
        ("tests/plc_interface/registers/test_codec.py", "tests/plc_interface/registers/test_map.py"),
    ),
    "seals": Room(("station.records.seals",), ("tests/records/test_seals.py",)),
    "limits": Room(
        (
            "station.inspection.sized_limits", "station.inspection.uncertainty", "station.inspection.monotone",
            "station.inspection.curve",
        ),
        (
            "tests/inspection/test_sized_limits.py",
            "tests/inspection/test_uncertainty.py",
            "tests/inspection/test_monotone.py",
            "tests/inspection/test_curve.py",
        ),
    ),
    "cycle": Room(
        ("station.inspection.cycle", "station.inspection.deadlines", "station.inspection.states"),
        ("tests/inspection/test_cycle.py", "tests/inspection/test_deadlines.py", "tests/inspection/test_export.py"),
    ),
    "recipes": Room(
        ("station.settings.recipe_model", "station.settings.damage", "station.settings.recipe"),
        ("tests/settings/test_recipe.py", "tests/settings/test_export.py"),
    ),
}  # fmt: skip
"""By the name on the command line."""
