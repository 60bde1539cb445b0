"""Service settings: placing, reset, deadlines, and limits of a good reference."""

from typing import Literal

from station.settings.model import Settings, setting


class ReferenceSettings(Settings):
    """Limits of a reference that is good enough to measure against."""

    oldest_s: float = setting(
        30.0,
        title="Oldest reference",
        description="Between the reference and the last step's frame; light and gel drift, so an older one misleads.",
        unit="s",
        ge=1.0,
        le=3600.0,
    )
    saturated_share: float = setting(
        0.05,
        title="Saturated share",
        description="Largest share of pixels at the end of the grey scale.",
        gt=0.0,
        le=1.0,
    )
    least_sharpness: float = setting(
        0.7,
        title="Least sharpness",
        description="Detail as a share of the golden reference's; less is a fogged lens. Found on the twin, where 0.6 "
        "to 0.9 of its worst fog reach it, from unit to unit.",
        gt=0.0,
        le=1.0,
    )
    most_change: float = setting(
        1.6,
        title="Most change",
        description="The contact gate's statistic of a new reference against the golden one; more means that something "
        "touches the gel. On the twin a touch of 0.25 mm gives 1.7 or more, half a day's drift of the light 1.5.",
        gt=0.0,
        le=100.0,
    )
    most_drift_levels: float = setting(
        25.0,
        title="Most drift",
        description="Root mean square of the light's change since the golden reference; more asks for a look at the "
        "LEDs and a new golden reference.",
        unit="grey levels",
        gt=0.0,
        le=255.0,
    )


class ServiceSettings(Settings):
    """The station's own process."""

    bench: bool = setting(
        default=False,
        title="Bench",
        description="No arm: the gripper is fixed and the fruit lies between its fingers.",
    )
    placing: Literal["nest", "arm"] = setting(
        "nest",
        title="Placing",
        description="`nest` lets the fruit go where it lay, for the line to divert; `arm` carries it to the accept or "
        "reject pose by its outcome.",
    )
    automatic_reset: bool = setting(
        default=True,
        title="Automatic reset",
        description="Make ready after a start, and in production mode after a fault that is gone: the jaws open and "
        "the arm goes home. After a safety stop or a person's stop, or with a fruit left between the jaws, a person's "
        "reset is always needed, also after a restart.",
    )
    uncalibrated: Literal["refuse", "allow"] = setting(
        "refuse",
        title="Without a calibration",
        description="`refuse` inspects nothing with a sensor that was never calibrated: its scale is known to 15 % "
        "only. `allow` is for a bench or a study; each record states it.",
    )
    inspection_deadline_s: float | None = setting(
        15.0,
        title="Inspection's deadline",
        description="From trigger to outcome; what is not judged by then is NO_RESULT with the reason late. The PLC's "
        "time-out has to be longer. A recipe whose longest way needs more is refused. Null for a deadline of each "
        "recipe's own, which `patience` stretches.",
        unit="s",
        ge=1.0,
        le=600.0,
    )
    patience: float = setting(
        2.0,
        title="Patience",
        description="Factor on the time that each phase is expected to take, before it is a device's fault; more "
        "for a machine that has other work.",
        ge=1.0,
        le=50.0,
    )
    clean_up_deadline_s: float = setting(
        20.0,
        title="Clean-up's deadline",
        description="After the outcome: longest wait until the jaws are open and the arm is home.",
        unit="s",
        ge=1.0,
        le=120.0,
    )
    retry_longest_s: float = setting(
        10.0,
        title="Longest pause",
        description="Between two tries to reach a device again; the first comes after a quarter of a second.",
        unit="s",
        ge=0.25,
        le=300.0,
    )
    progress_s: float = setting(
        5.0,
        title="Progress",
        description="Without progress of the cycle or of a device for so long, the heartbeat to the PLC stops.",
        unit="s",
        ge=1.0,
        le=60.0,
    )
    reference: ReferenceSettings = setting(
        ReferenceSettings(), title="Reference", description="When a picture of the untouched gel is good enough."
    )
