"""From pixels to millimetres."""

TYPICAL_MM_PER_PX = 0.0266
TYPICAL_IMAGE_PX = 640 * 480


def typical_mm_per_px(height_px: int, width_px: int) -> float:
    """The typical scale of a DIGIT for an image of this size."""
    return TYPICAL_MM_PER_PX * (TYPICAL_IMAGE_PX / (height_px * width_px)) ** 0.5
