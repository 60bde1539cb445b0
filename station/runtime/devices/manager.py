"""Device manager: opens and monitors the devices, and recovers them where that is safe."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable

from station.channel.panel import RecoveryName
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.ur import UrArm
from station.devices.camera.interface import CameraError, Leds, describe
from station.devices.camera.open import camera_from
from station.devices.gripper.errors import (
    NEEDS_ACTIVATION,
    GripperEmergencyStopError,
    GripperError,
    GripperFaultError,
    GripperNotActiveError,
    GripperTimeoutError,
)
from station.devices.gripper.interface import GripperReading
from station.devices.gripper.robotiq import make_gripper
from station.errors import StationError
from station.messages import camera as camera_messages
from station.messages import device as device_messages
from station.messages import gripper as gripper_messages
from station.press.reference import are_open
from station.runtime.devices.calibration import ActiveCalibration
from station.runtime.devices.monitor import DeviceMonitor
from station.runtime.devices.rig import FRAME_DEADLINE_S, HEALTH_LEASE_S, Cell, FramesError
from station.settings.configuration import Configuration

log = logging.getLogger(__name__)

CAMERA, GRIPPER, ARM = "camera", "gripper", "arm"
TITLES = {CAMERA: device_messages.CAMERA(), GRIPPER: device_messages.GRIPPER(), ARM: device_messages.ARM()}
SAFETY_STOPS = {ArmCause.PROTECTIVE_STOP, ArmCause.EMERGENCY_STOP, ArmCause.SAFETY_FAULT}
"""Stops by the arm's safety controller that a person has to check at the cell."""
_BAD_FRAMES = 3
"""Checks with a bad frame in a row that make a fault: an estimate."""
_OPENING_SHARE = 0.5
"""Share of `service.progress_s` that the opening of a camera may take at most: an estimate."""
_STALE_CHECKS = 3
"""Failed checks in a row that make a fault: one may be a moment's delay of this machine."""
_ARM_PAUSE_S = 0.5
"""The driver reconnects to the arm by itself; only its state is read."""
_OVER_TEMPERATURE = 0x8
"""Fault code gFLT (Robotiq manual)."""
_OLD_WIDTH_S = 1.0
"""Age from which a width that was read is not shown any more, s: an estimate."""
_STOP_SHOWN_S, _STOP_POLL_S = 0.3, 0.1
"""So long after the gripper has lost its power the arm's state may show the emergency stop that took it."""


class DeviceManager:
    """Camera, gripper and arm of one station with their monitors.

    Args:
        on_change: gets a device's name and its fault from now on, None for no fault.
        on_progress: gets a device's name after each of its checks.
    """

    def __init__(
        self,
        configuration: Configuration,
        on_change: Callable[[str, StationError | None], None],
        on_progress: Callable[[str], None],
    ) -> None:
        arm = None if configuration.service.bench else UrArm(configuration.arm)
        self._arm, self._configuration = arm, configuration
        # A camera that is waited for is progress only from check to check.
        opening_s = min(configuration.camera.open_deadline_s, _OPENING_SHARE * configuration.service.progress_s)
        camera = camera_from(configuration.camera.model_copy(update={"open_deadline_s": opening_s}))
        self.cell = Cell(camera, make_gripper(configuration.gripper, self._emergency_stopped), arm)
        self.calibration = ActiveCalibration(configuration, lambda: self.cell.camera.description.serial)
        """Of the camera in use."""
        self.simulated = (
            configuration.camera.driver != "digit"
            or (arm is not None and configuration.arm.host.startswith("127."))
            or (configuration.gripper.driver == "urcap" and configuration.gripper.urcap.host.startswith("127."))
        )
        self.light_by_hand = False
        """Whether the sensor's light may be another than the configuration's."""
        self._confirmed_clear = False
        self._recovery = asyncio.Lock()
        """Held while a lost activation is being restored, which may move the arm and moves the fingers."""
        self._gripper_reading: GripperReading | None = None
        self.joints_rad: tuple[float, ...] | None = None
        """The arm's joint positions as last monitored; None where it does not report them."""
        self._bad_frames, self._stale_checks = 0, 0
        self._not_activated: GripperError | None = None
        """Why the gripper's activation was refused or failed. An error of the arm or of a wire says nothing of it."""
        checks = {CAMERA: self._check_camera, GRIPPER: self._check_gripper}
        if arm is not None:
            checks[ARM] = self._check_arm
        self.monitors = {
            name: DeviceMonitor(
                name,
                TITLES[name],
                check,
                _ARM_PAUSE_S if name == ARM else configuration.service.retry_longest_s,
                lambda fault, name=name: on_change(name, fault),
                lambda name=name: on_progress(name),
            )
            for name, check in checks.items()
        }
        self._tasks: list[asyncio.Task[None]] = []

    async def open(self) -> None:
        """Start the monitors; they wait for a device that is away."""
        if self._arm is not None:
            await self._arm.open()
        self._tasks = [
            asyncio.create_task(monitor.run(), name=f"monitor of the {name}") for name, monitor in self.monitors.items()
        ]

    async def close(self) -> None:
        """Close the devices. Nothing is moved."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.cell.camera.close()
        with contextlib.suppress(GripperError):
            await self.cell.gripper.close()
        if self._arm is not None:
            await self._arm.close()

    @property
    def names(self) -> dict[str, str]:
        """Return the devices' names for the records."""
        camera, gripper = self.cell.camera.description.name, self._configuration.gripper.driver
        names = {CAMERA: camera, GRIPPER: f"Robotiq 2F-85 by {gripper}"}
        return names if self._arm is None else {**names, ARM: f"UR10e at {self._configuration.arm.host}"}

    @property
    def faults(self) -> dict[str, StationError]:
        """Return the faults by device; empty if all are healthy."""
        return {name: monitor.fault for name, monitor in self.monitors.items() if monitor.fault is not None}

    def healthy_since(self, since_s: float) -> bool:
        """Check that every device was found healthy after a monotonic time, and none has a fault."""
        monitors = self.monitors.values()
        return all(each.fault is None and each.heard_s is not None and each.heard_s > since_s for each in monitors)

    def use(self, *, by_inspection: bool) -> None:
        """Leave camera and gripper to an inspection, or monitor them again; the arm is always monitored."""
        if by_inspection:
            self._confirmed_clear = False
        for name in (CAMERA, GRIPPER):
            self.monitors[name].use(by_inspection=by_inspection)

    def confirm_clear(self) -> None:
        """Note that a person has confirmed that nothing is between the jaws.

        Valid for one activation, and only until the gripper is found active: from then on it may close on something.
        """
        self._confirmed_clear = True

    def report_fault(self, fault: StationError) -> None:
        """Report a fault that a caller met while it worked with a device."""
        match fault:
            case ArmFault():
                self.monitors[ARM].report_fault(fault)
            case GripperError():
                self.monitors[GRIPPER].report_fault(fault)
            case CameraError() | FramesError():
                self.monitors[CAMERA].report_fault(fault)
            case _:
                pass

    def width_mm(self) -> float | None:
        """Return the fingers' width as last monitored; None if that is too old, as during an inspection."""
        reading = self._gripper_reading
        return reading.width_mm if reading is not None and reading.age_s(time.monotonic()) < _OLD_WIDTH_S else None

    @property
    def active_stop(self) -> StationError | None:
        """Return the active safety stop that only a person may end."""
        return next((fault for fault in self.faults.values() if _is_stop(fault)), None)

    def renew_health(self) -> None:
        """Let the arm move for `HEALTH_LEASE_S` from now; its controller stops it when the lease runs out."""
        if self._arm is not None:
            self._arm.renew_health(HEALTH_LEASE_S)

    async def halt(self) -> None:
        """Stop arm and gripper where they are. Never raises: the monitors find a device that does not answer."""

        async def quietly(stop: Callable[[], object]) -> None:
            try:
                with contextlib.suppress(StationError, TimeoutError):
                    result = stop()
                    if asyncio.iscoroutine(result):
                        await result
            except Exception:  # a bug in one driver must neither keep the other device moving nor end the cycle
                log.exception("a device was not stopped")

        await asyncio.gather(
            quietly(self.cell.gripper.stop), quietly(self._arm.stop if self._arm is not None else lambda: None)
        )

    async def recover(self, what: RecoveryName) -> None:
        """Recover the arm after a stop that a person at the cell has checked; nothing moves by it.

        Raises:
            ArmFault: the recovery failed.
        """
        if self._arm is None:
            return
        match what:
            case "protective-stop":
                await self._arm.confirm_protective_stop()
            case "power":
                await self._arm.power_on_and_release_brakes()
            case "program":
                await self._arm.upload_again()
        self.monitors[ARM].check_now()

    async def restart_program(self) -> None:
        """Restart the arm's program after a stop whose cause is gone; a playing one does not change.

        Raises:
            ArmFault: the program does not play.
        """
        if self._arm is not None:
            await self._arm.upload_again()
            self.monitors[ARM].check_now()

    @property
    def power_missing(self) -> StationError | None:
        """Return the fault of an arm without power or with its brakes on, as after an emergency stop's release."""
        fault = self.faults.get(ARM)
        return fault if isinstance(fault, ArmFault) and fault.cause is ArmCause.NOT_POWERED else None

    @property
    def program_stopped(self) -> bool:
        """Check whether a person has stopped the arm's program on the pendant."""
        fault = self.faults.get(ARM)
        return isinstance(fault, ArmFault) and fault.cause is ArmCause.PROGRAM_STOPPED

    @property
    def needs_program_restart(self) -> bool:
        """Check whether the arm stopped only because this station was too slow for the controller's watchdog.

        Such a stop is the station's own, as after a lost link: once the station is healthy no person is needed.
        """
        fault = self.monitors[ARM].fault if ARM in self.monitors else None
        return isinstance(fault, ArmFault) and fault.cause is ArmCause.WATCHDOG

    async def activate_if_safe(self, may: Callable[[], bool]) -> None:
        """Activate a gripper that lost its activation, unless a fruit may be between the jaws: it would be crushed.

        Nothing is between them if the arm is away from the nest, or a person has confirmed it. With the jaws open at
        the nest the arm leaves the nest first; a gripper that was without power cannot report whether they are open.

        Args:
            may: whether the station may make itself ready. Once it may not, no further motion begins.

        Raises:
            StationError: activation is not safe, with the remedy; or it failed or was stopped.
        """
        async with self._recovery:
            reading = await self.cell.gripper.read()
            if not reading.needs_activation:
                self._confirmed_clear = False
                return
            try:
                if not self._confirmed_clear:
                    await self._leave_the_nest(may)
                if not may():
                    return
                self._confirmed_clear = False
                await self.cell.gripper.activate()
            except (GripperNotActiveError, GripperFaultError) as error:
                self._not_activated = error
                raise
            except GripperTimeoutError as error:
                self._not_activated = GripperNotActiveError(error.cause, error.remedy)
                raise
            self._not_activated = None

    def withdraw_confirmation(self) -> None:
        """Have the jaws confirmed anew before the next activation."""
        self._confirmed_clear = False

    async def end_recovery(self) -> None:
        """Stop the restoring of a lost activation, and wait for its end; a later one needs the jaws confirmed anew.

        Fingers that travel already come to their end, which nothing but their power prevents.
        """
        self.withdraw_confirmation()
        if self._recovery.locked():
            await self.halt()
            async with self._recovery:
                pass

    async def _leave_the_nest(self, may: Callable[[], bool]) -> None:
        refusal = GripperNotActiveError(gripper_messages.JAWS_UNKNOWN(), gripper_messages.REMEDY_EMPTY_JAWS())
        if self._arm is None:
            raise refusal
        state = await self._arm.state()
        if state.fault is not None:
            raise state.fault.again()
        gripper, width_mm = self.cell.gripper, self.cell.gripper.known_width_mm
        if state.at == "nest" and width_mm is not None and are_open(width_mm, gripper.max_width_mm):
            if may():
                await self._arm.move_to("above_nest")
        elif state.at not in {"home", "above_nest"}:
            raise refusal

    async def _emergency_stopped(self) -> bool:
        """Check whether the arm reports an emergency stop; the URCap's answer is the same with a broken cable."""
        until_s = time.monotonic() + _STOP_SHOWN_S
        while self._arm is not None:
            fault = (await self._arm.state()).fault
            if fault is not None and fault.cause is ArmCause.EMERGENCY_STOP:
                break
            if time.monotonic() > until_s:
                return False
            await asyncio.sleep(_STOP_POLL_S)
        return True

    async def set_light(self, light: Leds) -> None:
        """Set the sensor's light by hand, until `restore_light`.

        Raises:
            CameraError: the camera does not answer.
        """
        self.light_by_hand = True
        await self.cell.camera.set_leds(light)

    async def restore_light(self) -> None:
        """Set the configuration's light again where a person has set another: fruit is measured in no other.

        Raises:
            CameraError: the camera does not answer.
        """
        if not self.light_by_hand:
            return
        light = self._configuration.camera.digit
        # Cleared first, so that another light that is set meanwhile is restored as well.
        self.light_by_hand = False
        try:
            await self.cell.camera.set_leds(Leds(light.red, light.green, light.blue))
        except BaseException:
            self.light_by_hand = True
            raise

    async def _check_camera(self) -> None:
        await self.cell.camera.open()
        newer_than_s = time.monotonic()
        frame = await self.cell.camera.frame(newer_than_s, FRAME_DEADLINE_S)
        self._bad_frames = self._bad_frames + 1 if frame.faults else 0
        known_ill = isinstance(self.monitors[CAMERA].fault, FramesError)  # which only a good frame ends
        if self._bad_frames >= _BAD_FRAMES or (frame.faults and known_ill):
            raise FramesError(
                camera_messages.BAD_FRAMES(number=self._bad_frames, faults=describe(frame.faults)),
                frame.faults,
            )

    async def _check_gripper(self) -> None:
        reading = await self.cell.gripper.read()
        self._gripper_reading = reading
        if not reading.needs_activation:  # from now on it may hold something
            self._confirmed_clear, self._not_activated = False, None
        if reading.fault_code in NEEDS_ACTIVATION or reading.fault_code == _OVER_TEMPERATURE:
            fault = GripperFaultError(reading.fault_code)
        elif not reading.active:
            fault = GripperNotActiveError(gripper_messages.NOT_ACTIVE(), gripper_messages.REMEDY_WAIT())
        else:
            return
        raise (self._not_activated or fault).again()

    async def _check_arm(self) -> None:
        assert self._arm is not None  # noqa: S101 (the monitor exists only with an arm)
        state = await self._arm.state()
        self.joints_rad, fault = state.joints_rad, state.fault
        stale = fault is not None and fault.cause is ArmCause.STALE
        self._stale_checks = self._stale_checks + 1 if stale else 0
        if fault is not None and not 0 < self._stale_checks < _STALE_CHECKS:
            raise fault.again()


def _is_stop(fault: StationError) -> bool:
    """Check whether a fault is a safety stop, as the arm or the gripper on it reports it."""
    stopped_arm = isinstance(fault, ArmFault) and fault.cause in SAFETY_STOPS
    return stopped_arm or isinstance(fault, GripperEmergencyStopError)
