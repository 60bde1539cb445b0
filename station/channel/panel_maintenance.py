"""Messages of the maintenance page: health, jogging, live image, calibration, PLC registers, log."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from station.channel.line import RegisterView
from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.messages.message import Message

MOST_LINES = 500
HISTOGRAM_BINS = 32

Serial = Annotated[str, Field(max_length=64)]


class GetHealth(ChannelMessage):
    """Query the state of every part, with ages."""


class PartHealth(ChannelMessage):
    """State of one part that an inspection needs."""

    name: str
    state: Literal["ok", "degraded", "fault", "unknown"]
    """`degraded` still inspects."""
    age_s: float | None
    """Since it was last heard; None where never."""
    detail: Message | None = None
    remedy: Message | None = None
    """None only if ok."""


class Health(ChannelMessage):
    """State of every part."""

    ready: bool
    why: Message | None
    mode: int
    """PackML: 1 production, 2 maintenance, 3 manual."""
    state: Message
    """The present activity."""
    jog_refused: Message | None
    """Why jogging is refused now, with what to do; None if it is allowed."""
    width_mm: float | None
    """Between the fingers, as last monitored; None during an inspection, and where the gripper does not answer."""
    parts: tuple[PartHealth, ...]
    devices: dict[str, str]
    versions: dict[str, str]
    records: dict[str, int]
    """Bytes and counts of the records."""
    records_error: Message | None
    calibration_age_s: float | None
    verification_age_s: float | None
    simulated: bool


class JogGripper(ChannelMessage):
    """Move the fingers, slowly and with the least force; in manual mode only. Answered with `Jogged`."""

    to: Literal["open", "width", "stop"]
    width_mm: float | None = Field(default=None, ge=0.0, le=85.0, allow_inf_nan=False)
    """For `to` = `width`."""
    actor: Actor


class Jogged(ChannelMessage):
    """Position of the fingers."""

    width_mm: float
    object_state: str
    active: bool


class SetLeds(ChannelMessage):
    """Set the sensor's light; in manual mode only. Answered with `LedsSet`."""

    red: int = Field(ge=0, le=15)
    green: int = Field(ge=0, le=15)
    blue: int = Field(ge=0, le=15)
    actor: Actor


class LedsSet(ChannelMessage):
    """The camera has accepted the light setting."""


class GetLiveImage(ChannelMessage):
    """Query the sensor's newest image."""

    contact: bool = False
    """Draw in what is measured against the golden reference, by the active recipe's method."""
    newer_than_s: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)
    """Monotonic time of the image that the asker has."""


class ImageFile(ChannelMessage):
    """An image's file."""

    model_config = ConfigDict(ser_json_bytes="base64", val_json_bytes="base64")
    media_type: str
    data: bytes


class LiveImage(ChannelMessage):
    """An image with its time and contact."""

    model_config = ConfigDict(ser_json_bytes="base64", val_json_bytes="base64")
    picture: ImageFile
    captured_s: float
    """Monotonic."""
    age_s: float
    faults: tuple[str, ...]
    histogram: tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]
    """Pixels a bin from dark to bright, of red, green and blue."""
    saturated_share: float
    sharpness: float
    """Root mean square of the image's detail, grey levels."""
    area_px: int | None
    """None where no contact was measured."""
    area_mm2: float | None
    flags: tuple[str, ...]
    contact: Message | None
    """Why no contact was measured; None if it was, or was not requested."""


class GetCalibration(ChannelMessage):
    """Query the sensor's calibration and its last verification."""


class CheckView(ChannelMessage):
    """One check of a calibration or verification."""

    name: Message
    passed: bool
    found: Message
    expected: Message
    remedy: Message


class CalibrationView(ChannelMessage):
    """One calibration or verification."""

    serial: str
    id: str
    made_utc_ms: int
    operator: str
    words: Message | None
    """Its result in one line."""
    passed: bool
    checks: tuple[CheckView, ...]
    folder: str
    """Where its files are."""
    pictures: tuple[str, ...]
    """Names of its plots there."""


class RunStep(ChannelMessage):
    """One step reported by a calibration run."""

    number: int
    of: int
    title: Message
    detail: Message | None


class CalibrationRunView(ChannelMessage):
    """A calibration or verification, in progress or the last one."""

    kind: Literal["calibration", "verification"]
    state: Literal["running", "waiting", "passed", "failed", "ended"]
    """`waiting` for the person to lay the ball."""
    request: Message | None
    """The person's next action."""
    steps: tuple[RunStep, ...]
    """The last of each title."""
    result: Message | None
    """None while it runs."""


class CalibrationState(ChannelMessage):
    """State of the sensor's calibration."""

    serial: str
    in_use: Message
    """The scale."""
    calibration: CalibrationView | None
    verification: CalibrationView | None
    age_s: float | None
    verification_age_s: float | None
    oldest_days: float
    verify_every_h: float | None
    trouble: Message | None
    ball_mm: float
    run: CalibrationRunView | None
    run_refused: Message | None
    """Why no run can start now."""
    gel_change_refused: Message | None
    """Why a change of the gel cannot be noted now."""


class StartCalibrationRun(ChannelMessage):
    """Calibrate or verify, in manual mode: the gripper closes on the ball. Answered with `CalibrationRunView`."""

    kind: Literal["calibration", "verification"]
    places: tuple[tuple[float, float], ...] = Field(default=(), max_length=6)
    """Further places of the ball, mm beside its first; the run requests each in turn."""
    actor: Actor


class ContinueCalibrationRun(ChannelMessage):
    """Confirm that the ball is in place. Answered with `CalibrationRunView`."""

    actor: Actor


class EndCalibrationRun(ChannelMessage):
    """Cancel the run; the jaws open. Idempotent; answered with `CalibrationRunView`."""

    actor: Actor


class NoteGelChange(ChannelMessage):
    """Note, in manual mode, that the sensor's gel was changed: no calibration is in force until the next one.

    Answered with `CalibrationState`.
    """

    actor: Actor


class GetRegisters(ChannelMessage):
    """Query the PLC's registers; the PLC interface sends them with its next beat."""


class Registers(ChannelMessage):
    """All registers of the map, in the order of their addresses, and the handshake's faults."""

    registers: tuple[RegisterView, ...]
    age_s: float | None
    """Since the PLC interface sent them; None if it has not yet."""
    faults: tuple[Message, ...] = ()
    """What the PLC does wrong, until it gives clear_error."""


class ReadLog(ChannelMessage):
    """Read the last lines of the log."""

    limit: int = Field(default=100, ge=1, le=MOST_LINES)
    level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"
    """The least."""


class LogLine(ChannelMessage):
    """One line."""

    utc_ms: int
    level: str
    logger: str
    text: str


class Log(ChannelMessage):
    """Lines since the start of the station's process, newest last."""

    lines: tuple[LogLine, ...]
