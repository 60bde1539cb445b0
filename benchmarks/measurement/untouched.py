"""The robust method on the twin's untouched gel: many units, each as it drifts away from its reference."""

from typing import NamedTuple

import numpy as np

from measurement.on_the_twin import FRAMES_PER_S, FRAMES_PER_STEP, conditions
from measurement.peers import PEER, contact_area_idea
from station.settings.segmentation import RobustParameters
from station.twin.digit.sensor import DigitSensor
from station.vision.contact import Contact
from station.vision.median import median_image
from station.vision.robust import RobustMethod
from station.vision.step import mean_image, measure_step
from station.vocabulary import Flag

UNITS = range(93_000, 93_060)
"""Nothing was chosen on them."""
CONDITIONS = ("plain", "drift doubled", "dead LED", "dirt on the gel")
AFTER_S = (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)
"""Since the reference; an inspection takes up to eight."""


class Untouched(NamedTuple):
    """Measurement of one untouched unit at one of the times."""

    contact: Contact
    response: float
    """The strongest of the light touches' response in the mean image."""
    peer_found: bool
    """Whether PyTouch's contact area has any area."""


def untouched(unit: int, condition: str) -> list[Untouched]:
    """Measure one untouched unit at each of the times."""
    options, parameters = conditions()[condition], RobustParameters()
    sensor = DigitSensor(unit, unit, options.noise, options.drift)
    frames = [sensor.frame(None, k / FRAMES_PER_S, options.condition) for k in range(options.references)]
    reference = median_image(frames)
    method, peer = RobustMethod(reference, parameters), contact_area_idea(reference)
    found: list[Untouched] = []
    for after_s in AFTER_S:
        times_s = [after_s + k / FRAMES_PER_S for k in range(FRAMES_PER_STEP)]
        frames = [sensor.frame(None, now_s, options.condition) for now_s in times_s]
        mean = mean_image(frames)
        contact = measure_step(method, frames)
        found.append(Untouched(contact, float(method.weak_response(mean)[0].max()), bool(np.any(peer(mean)))))
    return found


def untouched_table() -> list[str]:
    """False areas in each condition, whether they would be judged, and how near the light touches' gate they come."""
    header = "| untouched twin | frames | with a false area | on units | of them judged | `undecided` "
    lines = [
        header + f"| the weak-contact detector's response, at most | {PEER}: with a false area |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for condition in CONDITIONS:
        units = [untouched(unit, condition) for unit in UNITS]
        frames = [one for unit in units for one in unit]
        false = [one.contact for one in frames if one.contact.found]
        judged = [contact for contact in false if Flag.LOW_CONFIDENCE not in contact.flags]
        on = sum(any(one.contact.found for one in unit) for unit in units)
        undecided = sum(Flag.UNDECIDED in one.contact.flags for one in frames)
        lines.append(
            f"| {condition} | {len(frames)} | {len(false)} | {on} "
            f"| {len(judged)} | {undecided} | {max(one.response for one in frames):.1f} "
            f"| {sum(one.peer_found for one in frames)} |"
        )
    seconds = ", ".join(f"{after_s:g}" for after_s in AFTER_S)
    return [
        *lines,
        "",
        f"{len(UNITS)} units of the twin, {seconds} s after their reference. Nothing was chosen on them.",
    ]
