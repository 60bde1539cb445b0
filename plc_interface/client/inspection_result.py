"""Result block for a client."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from plc_interface.registers.map import BY_NAME


@dataclass(frozen=True, slots=True)
class InspectionResult:
    """One inspection's outcome, as read from the result block."""

    sequence: int
    trigger_id: int
    outcome: str
    """PASS, FAIL or NO_RESULT."""
    flags: frozenset[str]
    """Of `pass`, `area_valid`, `late`, `partial`, `simulated`."""
    reasons: frozenset[str]
    """Empty only for PASS; the bits' names of `result_reasons`."""
    area_mm2: float | None
    """To a hundredth; None where nothing valid was measured."""
    area_px: int | None
    closing_mm: float | None
    """To a hundredth."""
    confidence_pct: int | None
    recipe: int
    recipe_checksum: int
    ended_utc_ms: int
    duration_ms: int
    encoder: int
    lot_checksum: int
    fruit_length_mm: float | None
    """As given with the trigger, to a tenth; None where none was."""
    size_class: int | None
    """The same."""

    @property
    def passed(self) -> bool:
        """True if the fruit may go on: PASS, measured, in time. A simulated result counts as its outcome."""
        return self.outcome == "PASS" and {"pass", "area_valid"} <= self.flags and "late" not in self.flags


def published_result(block: Mapping[str, Any]) -> InspectionResult | None:
    """Return the result in one read of status and result block; None if there is none, or the read is torn.

    Args:
        block: decoded values by register names, None for a register's own "there is none".
    """
    sequence = block["result_sequence"]
    if "result_valid" not in BY_NAME["status"].names(block["status"]):
        return None
    if sequence == 0 or not sequence == block["result_sequence_again"] == block["result_sequence_end"]:
        return None
    return InspectionResult(
        sequence=sequence,
        trigger_id=block["result_trigger_id"],
        outcome=BY_NAME["result_outcome"].codes[block["result_outcome"]].name,
        flags=BY_NAME["result_flags"].names(block["result_flags"]),
        reasons=BY_NAME["result_reasons"].names(block["result_reasons"]),
        area_mm2=_hundredth(block["result_area_mm2_x100"]),
        area_px=block["result_area_px"],
        closing_mm=_hundredth(block["result_closing_mm_x100"]),
        confidence_pct=block["result_confidence_pct"],
        recipe=block["result_recipe"],
        recipe_checksum=block["result_recipe_checksum"],
        ended_utc_ms=block["result_ended_utc_ms"],
        duration_ms=block["result_duration_ms"],
        encoder=block["result_encoder"],
        lot_checksum=block["result_lot_checksum"],
        fruit_length_mm=block["result_fruit_length_mm_x10"] / 10 or None,
        size_class=block["result_size_class"] or None,
    )


def _hundredth(value: int | None) -> float | None:
    return None if value is None else value / 100
