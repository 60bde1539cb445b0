"""The robust method on the twin's untouched gel: many units, each as it drifts away from its reference."""

from measurement.on_the_twin import FRAMES_PER_S, FRAMES_PER_STEP, conditions
from station.settings.segmentation import RobustParameters
from station.twin.digit.sensor import DigitSensor
from station.vision.contact import Contact, Flag
from station.vision.robust import RobustMethod
from station.vision.step import measure_step

UNITS = range(32000, 32060)
"""Nothing was chosen on them."""
CONDITIONS = ("plain", "drift doubled", "dead LED", "dirt on the gel")
AFTER_S = (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)
"""Since the reference; an inspection takes up to eight."""


def untouched(unit: int, condition: str) -> list[Contact]:
    """What is found on one unit at each of the times."""
    options, parameters = conditions()[condition], RobustParameters()
    sensor = DigitSensor(unit, unit, options.noise, options.drift)
    references = [sensor.frame(None, k / FRAMES_PER_S, options.condition) for k in range(options.references)]
    method = RobustMethod(references, parameters)
    found: list[Contact] = []
    for after_s in AFTER_S:
        times_s = [after_s + k / FRAMES_PER_S for k in range(FRAMES_PER_STEP)]
        frames = [sensor.frame(None, now_s, options.condition) for now_s in times_s]
        found.append(measure_step(method, frames, parameters.least_confidence))
    return found


def untouched_table() -> list[str]:
    """False areas in each condition, and whether they would be judged."""
    lines = ["| untouched twin | frames | with a false area | on units | of them judged |", "|---|---|---|---|---|"]
    for condition in CONDITIONS:
        units = [untouched(unit, condition) for unit in UNITS]
        false = [contact for contacts in units for contact in contacts if contact.found]
        judged = [contact for contact in false if Flag.LOW_CONFIDENCE not in contact.flags]
        lines.append(
            f"| {condition} | {len(units) * len(AFTER_S)} | {len(false)} "
            f"| {sum(any(contact.found for contact in contacts) for contacts in units)} | {len(judged)} |"
        )
    seconds = ", ".join(f"{after_s:g}" for after_s in AFTER_S)
    return [
        *lines,
        "",
        f"{len(UNITS)} units of the twin, {seconds} s after their reference. Nothing was chosen on them.",
    ]
