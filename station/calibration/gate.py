"""Contact gate of a recipe, raised on a unit that is noisier than most."""

from station.settings.segmentation import LARGEST_GATE_RATIO, LARGEST_LEAST_BEND, Segmentation


def gated(segmentation: Segmentation, factor: float) -> Segmentation:
    """Raise both limits of the robust method's gate alike, by the factor of the unit's calibration, 1 or more."""
    if factor <= 1.0:
        return segmentation
    robust = segmentation.robust
    raised = {
        # `model_copy` does not validate, so the fields' bounds are enforced here.
        "gate_ratio": min(LARGEST_GATE_RATIO, factor * robust.gate_ratio),
        "least_bend": min(LARGEST_LEAST_BEND, factor * robust.least_bend),
    }
    return segmentation.model_copy(update={"robust": robust.model_copy(update=raised)})
