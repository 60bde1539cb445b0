"""Calibration settings: the ball, the range of a calibration, the tolerances of a verification."""

from station.settings.model import Settings, setting


class CalibrationSettings(Settings):
    """Calibrating with the rubber ball, and the check at the shift's start."""

    recipe: str = setting(
        "rubber_ball",
        title="Ball's recipe",
        description="The recipe whose width steps, frames and method the ball is pressed with.",
        pattern=r"^[a-z][a-z0-9_]{0,31}$",
    )
    ball_mm: float = setting(
        24.0, title="Ball", description="Diameter of the ball; the paper's is 24 mm.", unit="mm", ge=3.0, le=60.0
    )
    holder_mm: float = setting(
        18.0,
        title="Holder",
        description="Width that the ball's holder takes; the paper's 24 mm ball is met at 42 mm.",
        unit="mm",
        ge=0.0,
        le=60.0,
    )
    ball_tolerance_mm: float = setting(
        1.5,
        title="Ball's tolerance",
        description="How far from ball and holder the contact may begin; more is another ball, or the gripper's zero.",
        unit="mm",
        gt=0.0,
        le=10.0,
    )
    place_tolerance_mm: float = setting(
        0.05,
        title="Places' tolerance",
        description="How well the distance between two places of the ball is known: it bounds the scale's uncertainty.",
        unit="mm",
        gt=0.0,
        le=1.0,
    )
    oldest_days: float = setting(
        90.0,
        title="Oldest calibration",
        description="An older one raises the alarm calibration_old. A starting value; the gel wears with use.",
        unit="days",
        gt=0.0,
        le=3650.0,
    )
    verify_every_h: float | None = setting(
        None,
        title="Verification demanded",
        description="No fruit is inspected later than this after the last passed verification; null requires none.",
        unit="h",
        gt=0.0,
        le=8760.0,
    )
    area_tolerance: float = setting(
        0.1,
        title="Area's tolerance",
        description="Of the ball's areas against the calibration's at the same widths, relative. Repeats on the twin "
        "differ by up to 0.04.",
        gt=0.0,
        le=1.0,
    )
    onset_tolerance_mm: float = setting(
        0.9,
        title="Onset's tolerance",
        description="Shift of the width at which the contact begins; two counts of the gripper and some noise.",
        unit="mm",
        gt=0.0,
        le=10.0,
    )
    least_light: float = setting(
        0.75,
        title="Least light",
        description="Of each colour against the calibration; less is a dimmed LED, and below a third of it a dead one.",
        gt=0.0,
        le=1.0,
    )
    least_contrast: float = setting(
        0.75,
        title="Least contrast",
        description="Of the change that the ball makes in the image against the calibration; less is a worn gel.",
        gt=0.0,
        le=1.0,
    )
    most_noise: float = setting(
        2.0,
        title="Most noise",
        description="Factor on the pixels' noise at the calibration.",
        ge=1.0,
        le=20.0,
    )
