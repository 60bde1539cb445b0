"""Camera settings."""

from typing import Literal

from station.settings.model import Settings, setting
from station.settings.network import Port


class DigitSettings(Settings):
    """A DIGIT on USB."""

    serial: str = setting(
        "D20966",
        title="Serial number",
        description="The DIGIT's serial number as udev reports it (ID_SERIAL_SHORT); printed on its housing.",
        pattern=r"^[A-Za-z0-9_-]{1,32}$",
    )
    red: int = setting(
        15, title="Red light", description="Brightness of the red LED; 15 is the sensor's default.", ge=0, le=15
    )
    green: int = setting(
        15, title="Green light", description="Brightness of the green LED; 15 is the sensor's default.", ge=0, le=15
    )
    blue: int = setting(
        15, title="Blue light", description="Brightness of the blue LED; 15 is the sensor's default.", ge=0, le=15
    )


class ReplaySettings(Settings):
    """Recorded frames that replace a sensor."""

    source: str = setting(
        ".",
        title="Source",
        description="A folder of images in natural order, or a video file.",
        min_length=1,
    )
    frames_per_s: float | None = setting(
        30.0,
        title="Rate",
        description="Frames a second in real time; null for as fast as they are requested.",
        unit="1/s",
        gt=0.0,
        le=240.0,
    )


class TwinCameraSettings(Settings):
    """The simulated DIGIT."""

    host: str = setting("127.0.0.1", title="Address", description="Address of the twin's camera.", min_length=1)
    port: Port = setting(5030, title="Port", description="TCP port of the twin's camera.")


class CameraSettings(Settings):
    """The tactile camera."""

    driver: Literal["digit", "replay", "twin"] = setting(
        "twin",
        title="Driver",
        description="`digit` for the sensor on USB, `replay` for recorded frames, `twin` for the simulation.",
    )
    mm_per_px: float = setting(
        0.0266,
        title="Scale",
        description="Size of a pixel on the gel; 0.0255 to 0.0291 from unit to unit, 0.0266 typical. Calibrate yours.",
        unit="mm",
        gt=0.001,
        le=1.0,
    )
    open_deadline_s: float = setting(
        5.0,
        title="Opening deadline",
        description="Longest wait for the first frame after opening. The station waits at most half of "
        "`service.progress_s` at once, and tries again.",
        unit="s",
        gt=0.0,
        le=60.0,
    )
    oldest_s: float = setting(
        0.2,
        title="Oldest frame",
        description="A frame that was captured longer ago than this is stale; six frames at 30 a second.",
        unit="s",
        gt=0.0,
        le=10.0,
    )
    digit: DigitSettings = setting(DigitSettings(), title="DIGIT", description="Used by the driver `digit`.")
    replay: ReplaySettings = setting(ReplaySettings(), title="Replay", description="Used by the driver `replay`.")
    twin: TwinCameraSettings = setting(TwinCameraSettings(), title="Twin", description="Used by the driver `twin`.")
