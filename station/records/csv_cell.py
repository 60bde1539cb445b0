"""Texts in CSV for spreadsheets."""

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet takes a text that begins so for a formula; lots' and growers' names come from outside."""


def csv_cell(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula: one that begins as such gets a `'` before it."""
    return f"'{text}" if text.startswith(_FORMULA) else text
