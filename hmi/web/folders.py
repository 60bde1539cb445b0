"""Folders of the pages: each holds a page's routes, templates, styles, scripts, texts and translations."""

from pathlib import Path

HMI = Path(__file__).parents[1]
PAGES = ("run", "change", "recipes", "history", "alarms", "maintenance", "setup", "configuration", "people", "jobs")
"""In the navigation's order. A new page is one more name here."""
FOLDERS = ("common", *PAGES)
