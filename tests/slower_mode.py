"""The sensor's slower mode, 15 frames a second: to draw, send and check 30 is a sixth of a whole station's work."""

from typing import Any

SLOWER_MODE: dict[str, Any] = {"do": "set", "device": "camera", "fault": "slow", "amount": 2.0}
"""The request to the twin's console."""
