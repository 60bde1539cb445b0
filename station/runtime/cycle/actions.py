"""Inspector: carries out an inspection's actions on the devices; each ends with an event."""

import asyncio
import itertools
import logging
import time
from collections.abc import Callable
from dataclasses import replace

from station.calibration.gate import gated
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import Frame
from station.devices.gripper.errors import LINK_ERRORS, GripperTimeoutError
from station.inspection.alarm_table import AlarmId
from station.inspection.centring import NOT_MOVED, Offset, off_middle, too_far
from station.inspection.cycle import REASONS, Event
from station.inspection.judge import judge
from station.inspection.second_press import FREED_BY_MM, needs_second_press
from station.messages import operation as messages
from station.messages.message import Message, message_of
from station.press import stop
from station.press.motion import Met, close_on, sweep
from station.press.procedure import back_off, onset, onset_again, take_step
from station.press.reference import ALARMS, BadReferenceError, JawsNotOpenError, are_open, open_jaws
from station.press.rig import MeasuredStep, Position, Step
from station.records.model import Image
from station.runtime.alarms.manager import AlarmManager
from station.runtime.cycle.inspection import Inspection
from station.runtime.devices.manager import CAMERA, GRIPPER, DeviceManager
from station.runtime.devices.rig import FRAME_DEADLINE_S, DeviceRig, at_once, open_freely
from station.runtime.imaging.worker import VisionWorker
from station.runtime.observability.metrics import Metrics
from station.settings.configuration import Configuration
from station.vocabulary import Reason

log = logging.getLogger(__name__)

_LET_GO_S, _LET_GO_AGAIN_S = 3.0, 0.2
"""The jaws are opened again with these pauses, for so long and at least once more; the cuts of `./run bench wire` are
shorter."""
_WIRE_FAULTS = (*LINK_ERRORS, GripperTimeoutError)


class Inspector:
    """The actions that need the devices. Each ends with an event or a device's `StationError`."""

    def __init__(
        self,
        devices: DeviceManager,
        vision: VisionWorker,
        configuration: Configuration,
        alarms: AlarmManager,
        metrics: Metrics,
    ) -> None:
        self._devices, self._vision = devices, vision
        self._settings, self._arm = configuration.service, configuration.arm
        self._alarms, self._metrics = alarms, metrics
        self._reached: Position | None = None
        self._measures_ahead = True
        """Whether frames are measured as they come. Not one that may need no measurement: it would slow the motion."""
        self._goes_on = asyncio.Event()
        """Set when a measured step lets another one be made."""

    async def open_jaws(self) -> Event:
        """Open the jaws and release what they hold."""
        await open_freely(self._devices.cell.gripper)
        return Event.JAWS_OPEN

    async def free_fruit(self, now: Inspection) -> Event:
        """Open only so far that the sensor can move beside the fruit, which may have rolled."""
        gripper = self._devices.cell.gripper
        if now.met_mm is None:
            raise RuntimeError("a fruit is freed that was not met")
        await open_freely(gripper, min(now.met_mm + FREED_BY_MM, gripper.max_width_mm))
        return Event.JAWS_OPEN

    async def go_home(self) -> Event:
        """Bring the arm to where it waits, and open the jaws fully meanwhile.

        From the nest, or from where it is not known, the arm goes over the place above it.
        """
        arm = self._devices.cell.arm

        async def leave() -> None:
            if arm is not None:
                if (await arm.state()).at not in {"home", "above_nest", "accept", "reject"}:
                    await arm.move_to("above_nest")
                await arm.move_to(self._arm.waits_at)

        await at_once(leave(), self._devices.cell.gripper.open())
        return Event.HOME

    async def check_jaws(self, now: Inspection) -> Event:
        """Make sure that the jaws are open before a reference is taken: else something may be held against the gel."""
        rig = self._rig(now)
        try:
            at = await rig.read()
            if at.blocked or not are_open(at.width_mm, rig.widest_mm):
                await open_jaws(rig)
        except JawsNotOpenError as error:
            now.interrupt(Reason.REFERENCE_BAD, messages.JAWS_NOT_OPEN(width_mm=error.width_mm))
            return Event.REFERENCE_BAD
        self._devices.monitors[GRIPPER].report_success()
        return Event.JAWS_OPEN

    async def approach(self, now: Inspection) -> Event:
        """Bring the jaws to the fruit, a little wider than it may be, while the reference is taken and examined."""
        jaws = self._devices.cell.gripper.open(self._width_around(now))
        *_, good = await at_once(self._rig(now).go("above_nest", "nest"), jaws, self._examined(now))
        return Event.ARRIVED if good else Event.REFERENCE_BAD

    def _width_around(self, now: Inspection) -> float:
        """The jaws' width beside any fruit that the recipe expects, and beside the one that was met."""
        recipe = now.active.recipe
        widest_mm = max(
            recipe.expected_width.largest_mm, recipe.steps.start_width_mm or 0.0, now.met_mm or 0.0, now.onset_mm or 0.0
        )
        return min(widest_mm + self._arm.jaw_clearance_mm, self._devices.cell.gripper.max_width_mm)

    async def _examined(self, now: Inspection) -> bool:
        """Take the reference's frames, while nothing touches the gel, and examine them.

        Returns:
            Whether they may serve as the reference; if not, the inspection and an alarm have the reason.
        """
        frames = await self._rig(now, self._count).frames(now.active.recipe.imaging.reference_frames)
        self._devices.monitors[CAMERA].report_success()
        now.reference_s = frames[-1].captured_s
        try:
            segmentation = gated(now.active.recipe.segmentation, self._devices.calibration.gate_factor)
            image, looks = await self._vision.take_reference(frames, segmentation)
        except BadReferenceError as error:
            now.interrupt(Reason.REFERENCE_BAD, message_of(error))
            self._alarms.raise_(error.alarm, message_of(error))
            self._metrics.reference_refused(error.alarm)
            return False
        now.reference_image = Image("reference", None, image)
        now.measures["gate_factor"] = self._devices.calibration.gate_factor  # without it no image can be measured again
        if self._devices.calibration.calibration is None:
            now.measures["uncalibrated"] = "allow"
        for alarm in ALARMS:
            self._alarms.clear(alarm)
        drift, most = looks.drift_levels, self._settings.reference.most_drift_levels
        halfway = messages.LIGHT_DRIFTS(drift_levels=drift, limit_levels=most)
        self._alarms.update(AlarmId.REFERENCE_DRIFTING, halfway if drift > most / 2 else None)
        self._metrics.reference(0.0, drift)
        now.measures["reference_drift_levels"] = round(drift, 2)
        now.measures["reference_sharpness_levels"] = round(looks.sharpness, 3)
        return True

    async def close_to_onset(self, now: Inspection) -> Event:
        """Close until the gel is touched, or to the recipe's start width; that image is the curve's first."""
        self._reached = None
        await self._vision.begin_press()
        rig, recipe, plan = self._rig(now), now.active.recipe, now.active.recipe.steps
        # Where the fruit was met before, the first frame is beside it.
        self._measures_ahead = plan.start_width_mm is not None or now.met_mm is None
        try:
            if plan.start_width_mm is not None:
                first = await self._vision.measure(await take_step(rig, recipe, 0, plan.start_width_mm))
            elif now.met_mm is not None:
                before, first = await onset_again(rig, recipe, Met(now.met_mm, now.clear_mm), self._seen)
                now.before_onset_mm = None if before is None else before.move.width_mm
            else:
                met = await sweep(rig, recipe, self._seen)
                stopped = await rig.read()
                now.measures["overshoot_mm"] = round(met.width_mm - stopped.width_mm, 2)
                opened, off = await self._backed_off(now, rig, met, stopped)
                if self._target_contact(now, off):
                    now.closings = 1
                    now.let_go(met.width_mm, opened.width_mm)
                    return Event.OFF_MIDDLE
                before, first = await onset(rig, recipe, opened, self._seen)
                now.before_onset_mm = None if before is None else before.move.width_mm
        except (stop.NothingTouchedError, stop.UnseenContactError) as error:
            now.interrupt(Reason.NO_CONTACT, message_of(error))
            return Event.NO_ONSET
        now.steps.append(first.step)
        now.seen.append(first)
        now.closings += 1
        off = self._off_middle(now, now.seen[-1])
        if plan.start_width_mm is not None and now.closings == 1 and self._target_contact(now, off):
            now.let_go(first.step.move.width_mm, None)
            return Event.OFF_MIDDLE
        if now.moved != NOT_MOVED and off is not None:
            now.measures["left_off_mm"] = round(off.length_mm, 2)
        await self._vision.follow(now.seen[-1].contact)
        return Event.ONSET_FOUND

    async def _backed_off(
        self, now: Inspection, rig: DeviceRig, met: Met, at: Position
    ) -> tuple[Position, Offset | None]:
        """Open to where nothing touched, and return how far the sweep's first contact was off the field's middle.

        The way is None where there was no contact any more; the fingers came to rest at `at`.
        """
        # Measured while the jaws open: they do so whatever it shows.
        measuring = asyncio.ensure_future(self._vision.measure(Step(-1, at, await rig.frames(1))))
        self._measures_ahead = False
        try:
            opened = await back_off(rig, met)
            return opened, self._off_middle(now, await measuring)
        finally:
            measuring.cancel()

    @staticmethod
    def _off_middle(now: Inspection, seen: MeasuredStep) -> Offset | None:
        """Return a measured contact's offset from the field's middle, mm; None where there is no contact."""
        centroid_px = seen.contact.centroid_px
        return None if centroid_px is None else off_middle(centroid_px, seen.image.shape, now.mm_per_px)

    def _target_contact(self, now: Inspection, off: Offset | None) -> bool:
        """Set the arm's target to centre a contact, and return True; record why one that is off is left."""
        from_mm = now.active.recipe.press.centre_from_mm
        if from_mm is None or off is None:
            return False
        now.measures.setdefault("off_right_mm", round(off.right_mm, 2))
        now.measures.setdefault("off_down_mm", round(off.down_mm, 2))
        if off.length_mm < from_mm:
            why_not = "near enough"
        elif self._devices.cell.arm is None:
            why_not = "no arm"
        elif too_far(off, now.moved, self._arm.centring.most_mm):
            why_not = "too far"
        else:
            now.target = now.moved.then(off)
            now.measures["centring"] = "moved"
            return True
        now.measures.setdefault("centring", why_not)
        return False

    async def centre(self, now: Inspection) -> Event:
        """Go to where the contact will be in the field's middle; nothing moves where it is to be pressed as it is."""
        arm, target = self._devices.cell.arm, now.target
        if arm is not None and target is not None:
            now.target = None
            try:
                await arm.move_beside_nest(self._arm.centring.in_tool_mm(*target))
            except ArmFault as fault:
                if fault.cause is not ArmCause.UNREACHABLE:
                    raise
                log.warning("the contact is not centred: %s", fault)
                now.measures["centring"] = "out of reach"
                return Event.CENTRED
            now.moved = target
            now.measures["moved_right_mm"] = round(target.right_mm, 2)
            now.measures["moved_down_mm"] = round(target.down_mm, 2)
        return Event.CENTRED

    async def close_step(self, now: Inspection) -> Event:
        """Close by one step, counted in measured widths from the first, or by all that the recipe makes without a stop.

        The step before is measured meanwhile, unless it may be the last: then its measurement comes first.
        """
        if self._may_decide(now) and len(now.seen) < len(now.steps):
            self._goes_on.clear()
            await self._goes_on.wait()
        if self._closes_on(now):
            await self._close_on(now)
        else:
            self._reached = await self._rig(now).close_to(now.next_width_mm)
            now.closed_steps += 1
        return Event.REACHED

    @staticmethod
    def _closes_on(now: Inspection) -> bool:
        """Return whether the next steps are made without a stop."""
        return now.active.recipe.steps.measured == "while_closing" and not now.closed_steps

    async def _close_on(self, now: Inspection) -> None:
        """Close without a stop to the last damage threshold that has to be met, measuring each frame on the way.

        The fingers stop sooner where an area ends the steps.
        """
        now.closed_steps = now.steps_to_decide

        async def goes_on(step: Step) -> bool:
            now.steps.append(replace(step, number=len(now.steps)))
            now.seen.append(await self._vision.measure(now.steps[-1]))
            if not stop.ends_steps(now.press(), now.active.recipe):
                return True
            # The image at rest may say otherwise, as one frame that is wrong makes an area fall: then it is stepped on.
            now.closed_steps = max(1, now.whole_steps_to(step.move.width_mm))
            return False

        # The frames are measured one by one: none is measured ahead, since each follows the one before.
        self._reached = await close_on(self._rig(now, self._count), now.active.recipe, now.deciding_width_mm, goes_on)

    @staticmethod
    def _may_decide(now: Inspection) -> bool:
        """Return whether the last captured step may decide, by a recipe that stops when decided."""
        closing_mm = None if now.onset_mm is None else now.onset_mm - now.steps[-1].move.width_mm
        return stop.may_decide(now.active.recipe, closing_mm)

    async def settle(self, now: Inspection) -> Event:
        """Let fruit and gel come to rest: every step waits as long, because fruit creeps.

        Not after closing without a stop: the image belongs to those taken on the way.
        """
        on_the_way = now.active.recipe.steps.measured == "while_closing" and now.closed_steps <= now.steps_to_decide
        await asyncio.sleep(0.0 if on_the_way else now.active.recipe.imaging.settle_s)
        return Event.SETTLED

    async def capture(self, now: Inspection) -> Event:
        """Take the step's frames, all of them captured from now on."""
        recipe, reached = now.active.recipe, self._reached
        if reached is None:
            raise RuntimeError("a step is captured that was not reached")
        frames = await self._rig(now).frames(recipe.imaging.frames_per_step)
        self._devices.monitors[CAMERA].report_success()
        self._devices.monitors[GRIPPER].report_success()
        now.steps.append(Step(len(now.steps), reached, frames))
        last = stop.is_last_step(recipe, now.closed_steps, now.next_width_mm, reached)
        return Event.LAST_CAPTURED if last else Event.CAPTURED

    async def measure(self, now: Inspection) -> Event:
        """Measure the captured step that is next in order, and say whether the recipe lets another one be made."""
        now.seen.append(await self._vision.measure(now.steps[len(now.seen)]))
        if stop.ends_steps(now.press(), now.active.recipe):
            return Event.EARLY_STOP
        self._goes_on.set()
        return Event.MEASURED

    async def judge(self, now: Inspection) -> Event:
        """Judge what was measured; an inconclusive fruit may be pressed once more, by the recipe."""
        age_s = now.seen[-1].step.last_frame.captured_s - (now.reference_s or 0.0)
        self._metrics.reference(age_s, float(now.measures.get("reference_drift_levels") or 0.0))
        if age_s > self._settings.reference.oldest_s:
            now.interrupt(
                Reason.REFERENCE_BAD,
                messages.REFERENCE_OLD(age_s=age_s, limit_s=self._settings.reference.oldest_s),
            )
        recipe = now.active.recipe
        now.verdict = judge(now.press(), recipe)
        if now.presses_made < recipe.press.attempts and needs_second_press(now.verdict):
            self._target_contact(now, self._off_middle(now, now.seen[-1]))
            now.press_again()
            self._metrics.pressed_again(recipe.name)
            return Event.PRESS_AGAIN
        now.outcome_name = now.verdict.outcome
        return Event.JUDGED_ACCEPT if now.outcome_name == "PASS" else Event.JUDGED_REJECT

    async def place(self, now: Inspection) -> Event:
        """Let the fruit go: in the nest, where the line diverts it, or where its outcome belongs."""
        carried = self._settings.placing == "arm" and self._devices.cell.arm is not None
        if carried:
            await self._rig(now).go("above_nest", "accept" if now.is_accepted else "reject")
        await self._let_go(None if carried else self._width_around(now))
        return Event.PLACED

    async def _let_go(self, width_mm: float | None) -> None:
        """Open, again for a time where the wire fails: its faults say nothing of the jaws, and opening does no harm.

        Only what stays unknown needs a person.
        """
        until_s = time.monotonic() + _LET_GO_S
        for attempt in itertools.count(1):
            try:
                await open_freely(self._devices.cell.gripper, width_mm)
            except _WIRE_FAULTS:
                if attempt > 1 and time.monotonic() > until_s:
                    raise
                await asyncio.sleep(_LET_GO_AGAIN_S)
            else:
                return

    @staticmethod
    def close_as_no_result(now: Inspection, because: Event, why: Message | None) -> None:
        """End an inspection that an event made impossible to judge, with what was measured so far."""
        now.interrupt(REASONS[because], why)
        now.verdict = judge(now.press(), now.active.recipe)
        now.outcome_name = "NO_RESULT"

    def _rig(self, now: Inspection, on_frame: Callable[[Frame], None] | None = None) -> DeviceRig:
        deadline_s = FRAME_DEADLINE_S * self._settings.patience
        return DeviceRig(self._devices.cell, now.active.recipe, deadline_s, on_frame or self._measure_ahead)

    def _measure_ahead(self, frame: Frame) -> None:
        self._count(frame)
        if not frame.faults and self._measures_ahead:
            self._vision.measure_ahead(frame)

    def _count(self, frame: Frame) -> None:
        for fault in frame.faults or ("good",):
            self._metrics.frame(fault)

    async def _seen(self, step: Step) -> MeasuredStep:
        """A step of the approach, measured by itself."""
        self._devices.monitors[CAMERA].report_success()
        self._devices.monitors[GRIPPER].report_success()
        seen = await self._vision.seek(step)
        self._measures_ahead = True
        return seen
