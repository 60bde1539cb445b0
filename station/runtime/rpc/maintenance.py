"""Maintenance page's requests: health, jogging in manual mode, live image, PLC registers, log."""

import asyncio
import time
from pathlib import Path

import cv2
import numpy as np

from station.calibration.gate import gated
from station.channel.panel import Actor
from station.channel.panel_maintenance import (
    HISTOGRAM_BINS,
    GetHealth,
    GetLiveImage,
    GetRegisters,
    Health,
    ImageFile,
    Jogged,
    JogGripper,
    LedsSet,
    LiveImage,
    Log,
    ReadLog,
    Registers,
    SetLeds,
)
from station.channel.server import Handlers
from station.channel.worker import PanelWorker
from station.devices.camera.interface import Frame, Image, Leds
from station.devices.gripper.calibration import SLOWEST_MM_S, WEAKEST_N
from station.errors import StationError
from station.inspection.states import STATES, State
from station.messages import maintenance as messages
from station.messages.commands import JOGGING
from station.messages.message import Message
from station.records.audit import AuditEntry
from station.runtime.devices.manager import GRIPPER
from station.runtime.imaging.golden_reference import GOLDEN
from station.runtime.observability.observability import Observability
from station.runtime.production.plc_commands import MANUAL
from station.runtime.production.production import Production
from station.runtime.rpc.log import LogRing
from station.settings.segmentation import Segmentation
from station.vision.contact import Contact, Method
from station.vision.image_quality import saturated_share, sharpness
from station.vision.methods import make_method
from station.vocabulary import Refusal

LIVE_IMAGE_DEADLINE_S = 2.0
"""Longest wait for the live image, s: an estimate."""
REGISTERS_DEADLINE_S = 3.0
"""Longest wait for the registers of the PLC interface's next beat, s: an estimate."""
_JOGGED = {State.IDLE, State.STOPPED, State.CARRIED}
"""States in which the cycle moves nothing."""
_JPEG_QUALITY = 85
"""Of the live image, 0 to 100: an estimate."""
_WHITE, _BLACK = (255, 255, 255), (0, 0, 0)


class NotNowError(StationError):
    """A request that is refused in this state; the message gives what has to be done first."""


class PanelMaintenance:
    """Requests of the maintenance page; every manual motion is audited.

    Args:
        home: folder of the golden reference of a sensor that is not calibrated.
        worker: makes pictures in its thread.
    """

    def __init__(
        self,
        production: Production,
        observability: Observability,
        home: Path,
        worker: PanelWorker,
        log: LogRing,
    ) -> None:
        self._service, self._devices, self._interlock = production.service, production.devices, production.interlock
        self._plc_commands, self._line_state, self._home = production.plc_commands, production.line_state, home
        self._audit, self._versions = observability.audit, dict(observability.versions)
        self._worker, self._log = worker, log
        self._moving = asyncio.Lock()
        self._method: tuple[object, Method] | None = None
        self.handlers: Handlers = {
            GetHealth: self.health,
            JogGripper: self.jog,
            SetLeds: self.set_leds,
            GetLiveImage: self.live_image,
            GetRegisters: self.registers,
            ReadLog: self.log_lines,
        }

    def refusal(self) -> Message | None:
        """Return why nothing may be moved by hand now, with the remedy; None if it may."""
        service = self._service
        if why := self.work_refusal():
            return why
        if service.state not in _JOGGED:
            return STATES[service.state].activity
        activity = service.manual_activity
        if activity is not None and not self._moving.locked():
            return messages.UNDER_WAY(activity=activity)
        return None

    def work_refusal(self) -> Message | None:
        """Return why nobody may work by hand now, also without a motion; None where no fruit can be inspected."""
        mode = self._plc_commands.mode
        if self._service.ending:
            return messages.ENDING()
        if STATES[self._service.state].refusal is Refusal.BUSY:
            return messages.BUSY()
        return None if mode == MANUAL else messages.SET_MANUAL(mode=mode, manual=MANUAL)

    async def health(self, _request: GetHealth) -> Health:
        """Return the health of all dependencies."""
        readiness, records, figures = (
            self._interlock.readiness(),
            self._service.registry.records,
            self._devices.calibration.figures,
        )
        status = await self._worker.do(records.status)
        return Health(
            ready=readiness.ready,
            why=readiness.why,
            mode=self._plc_commands.mode,
            state=STATES[self._service.state].activity,
            jog_refused=self.refusal(),
            width_mm=self._devices.width_mm(),
            parts=readiness.dependencies,
            devices=self._devices.names,
            versions=self._versions,
            records={
                "database_bytes": status.database_bytes,
                "image_bytes": status.image_bytes,
                "free_bytes": status.free_bytes,
                "queue": status.queue,
                "images_waiting": status.images_waiting,
                "writes": status.writes,
            },
            records_error=status.error,
            calibration_age_s=figures.age_s,
            verification_age_s=figures.verification_age_s,
            simulated=self._devices.simulated,
        )

    async def jog(self, request: JogGripper) -> Jogged:
        """Move the fingers, or stop them.

        Raises:
            NotNowError: refused in this state.
            GripperError: the fingers did not reach the width.
        """
        gripper, width_mm = self._devices.cell.gripper, request.width_mm
        if (request.to == "width") != (width_mm is not None):
            raise StationError(messages.JOG_WIDTH())
        self._check(request.actor, "maintenance.jog", request.to)
        if request.to == "stop":
            reading = await gripper.stop()
        else:
            if width_mm is not None and width_mm > gripper.max_width_mm:
                raise StationError(messages.JOG_TOO_WIDE(widest_mm=gripper.max_width_mm, width_mm=width_mm))
            if self._moving.locked():
                raise NotNowError(messages.JOG_MOVING())
            async with self._moving:
                with self._service.manual(JOGGING(), self._devices.halt):
                    wide_mm = gripper.max_width_mm if width_mm is None else width_mm
                    reading = (await gripper.move_to_width(wide_mm, SLOWEST_MM_S, WEAKEST_N)).reading
        self._devices.monitors[GRIPPER].report_success()
        where = f"{reading.width_mm:.1f} mm"
        self._note(
            request.actor, "maintenance.jog", request.to if width_mm is None else f"{width_mm:g} mm", {"reached": where}
        )
        return Jogged(width_mm=reading.width_mm, object_state=reading.object_state.value, active=reading.active)

    async def set_leds(self, request: SetLeds) -> LedsSet:
        """Set the sensor's light; the end of manual mode, a calibration and a verification restore the configuration's.

        Raises:
            NotNowError: refused in this state.
            CameraError: the camera does not answer.
        """
        self._check(request.actor, "maintenance.leds", "camera")
        await self._devices.set_light(Leds(request.red, request.green, request.blue))
        self._note(request.actor, "maintenance.leds", "camera", [request.red, request.green, request.blue])
        return LedsSet()

    async def live_image(self, request: GetLiveImage) -> LiveImage:
        """Return the newest image with its contact.

        The contact is measured with the unit's detection threshold, as in an inspection, but against the golden
        reference, and only while nothing is inspected.
        """
        frame = await self._devices.cell.camera.frame(request.newer_than_s, LIVE_IMAGE_DEADLINE_S)
        active = self._service.active
        why = None
        if request.contact and STATES[self._service.state].refusal is Refusal.BUSY:
            why = messages.IMAGE_BUSY()
        elif request.contact and active is None:
            why = messages.IMAGE_NO_RECIPE()
        segmentation = None
        if request.contact and active is not None and why is None:
            segmentation = gated(active.recipe.segmentation, self._devices.calibration.gate_factor)
        return await self._worker.do(lambda: self._live(frame, segmentation, why))

    async def registers(self, _request: GetRegisters) -> Registers:
        """Return the PLC's registers, requested with the next beat; after a while those of the last report."""
        asked_s = time.monotonic()
        self._line_state.request_registers()
        while self._line_state.registers[1] < asked_s and time.monotonic() < asked_s + REGISTERS_DEADLINE_S:
            await asyncio.sleep(0.05)
        (registers, at_s), report = self._line_state.registers, self._line_state.last_report
        faults = () if report is None else tuple(each.what for each in report.faults if each.part == "handshake")
        return Registers(registers=registers, age_s=time.monotonic() - at_s if at_s else None, faults=faults)

    async def log_lines(self, request: ReadLog) -> Log:
        """Return the last lines of the log."""
        return Log(lines=self._log.last(request.limit, request.level))

    def _check(self, actor: Actor, action: str, subject: str) -> None:
        if why := self.refusal():
            self._note(actor, action, subject, {"done": False, "why": str(why)})
            raise NotNowError(why)

    def _note(self, actor: Actor, action: str, subject: str, new: object) -> None:
        self._audit.log(AuditEntry(actor.who, actor.role, action, subject, new=new))

    def _live(self, frame: Frame, segmentation: Segmentation | None, why: Message | None) -> LiveImage:
        image, contact = frame.image, None
        shown = image
        if segmentation is not None:
            contact, why = self._contact(segmentation, image)
            shown = image if contact is None else _outlined(image, contact)
        data = cv2.imencode(".jpg", shown, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()
        blue, green, red = (_histogram(image[:, :, channel]) for channel in range(3))
        scale_mm = self._devices.calibration.in_force.mm_per_px
        return LiveImage(
            picture=ImageFile(media_type="image/jpeg", data=data),
            captured_s=frame.captured_s,
            age_s=time.monotonic() - frame.captured_s,
            faults=tuple(sorted(fault.value for fault in frame.faults)),
            histogram=(red, green, blue),
            saturated_share=saturated_share(image),
            sharpness=sharpness(image),
            area_px=contact.area_px if contact else None,
            area_mm2=contact.area_px * scale_mm**2 if contact else None,
            flags=tuple(sorted(flag.value for flag in contact.flags)) if contact else (),
            contact=why,
        )

    def _contact(self, segmentation: Segmentation, image: Image) -> tuple[Contact | None, Message | None]:
        """Return the contact against the golden reference, or why none is measured."""
        path = self._devices.calibration.golden() or self._home / GOLDEN
        try:
            key = (path, path.stat().st_mtime_ns, segmentation)
        except OSError:
            return None, messages.NO_GOLDEN()
        if self._method is None or self._method[0] != key:
            picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
            if picture is None:
                return None, messages.GOLDEN_UNREADABLE(file=path.name)
            self._method = key, make_method(np.asarray(picture, np.uint8), segmentation)
        try:
            return self._method[1].measure(image), None
        except ValueError:
            return None, messages.GOLDEN_SIZE()


def _outlined(image: Image, contact: Contact) -> Image:
    drawn = image.copy()
    outlines, _ = cv2.findContours(contact.mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(drawn, outlines, -1, _BLACK, 3)
    cv2.drawContours(drawn, outlines, -1, _WHITE, 1)
    return drawn


def _histogram(channel: np.ndarray) -> tuple[int, ...]:
    return tuple(
        int(count) for count in np.bincount(channel.ravel() // (256 // HISTOGRAM_BINS), minlength=HISTOGRAM_BINS)
    )
