"""Driver of a Universal Robots arm. Unverified on hardware."""

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator
from typing import Self, get_args

from station.devices.arm.arm import ArmState
from station.devices.arm.dashboard import DashboardConversation, dashboard
from station.devices.arm.diagnosis import PLAYING, STOPPED
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.link import ArmLink
from station.devices.arm.messages import Beside, Halt, Move, Position, Reachable, Six, Snapshot
from station.messages import arm as messages
from station.messages.message import Message
from station.settings.arm import ArmSettings, PoseName

POSES: tuple[PoseName, ...] = get_args(PoseName)
ARM_READY_S = 15.0
"""Longest wait of a command for the arm to be ready, s; an estimate."""
POLL_S = 0.02
ARRIVING_POLL_S = 0.004
"""While the arm brakes into its place: two of the controller's cycles."""
RECOVERY_POLL_S = 0.5
UNLOCK_AFTER_S = 5.1
"""A controller refuses to leave a protective stop in its first 5 s."""
AT_REST_RAD_S = 1e-3
BESIDE_WITHIN_RAD = 2e-4
"""Nearer than a step beside the nest: 0.3 mm of the tool are at least 4e-4. A place beside the nest is reached within
this, and an arm at rest within this of a pose is not sent there. Unverified on hardware."""
NEST_WAY_RAD = 0.03
"""How far a joint may be outside of its span between the nest and the place above it on the way between them. Estimate:
10 mm beside the nest (the most that `arm.centring.most_mm` allows) at 0.5 m from a joint are 0.02 rad; the rest is for
a straight line's bow in the joints."""
SHORT_AFTER_S = 0.3
"""Time for which an arm has to be at rest elsewhere before the motion counts as failed."""


class UrArm:
    """An `Arm` on ur-rtde, which lives in a process of its own. Belongs to the event loop in which it is opened.

    Moves to the nest, and from it or from the way to it, are straight for the tool; the others are straight for the
    joints.
    """

    def __init__(self, settings: ArmSettings) -> None:
        self._settings = settings
        self._link = ArmLink(settings)
        self._moving = asyncio.Lock()
        self._stopped = asyncio.Event()
        self._beside_rad: Six | None = None
        """Last target beside the nest."""
        self._reachable: set[tuple[int, PoseName]] = set()

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def open(self) -> None:
        """Start to connect; `ready` waits for the result. Idempotent."""
        await self._link.open()

    async def ready(self, deadline_s: float) -> None:
        """Wait until the arm is ready.

        Raises:
            ArmFault: it is not ready: as soon as only a person can help, or at the deadline.
        """
        await self._link.settled(deadline_s)

    async def close(self) -> None:
        """End the driver's process; the controller's watchdog stops the playing program."""
        await self._link.close()

    @property
    def process_id(self) -> int | None:
        """Return the id of the ur-rtde process; None if there is none."""
        return self._link.pid

    def renew_health(self, lease_s: float) -> None:
        """Renew the health lease, in seconds from now; when it runs out, the controller stops the arm."""
        self._link.renew_health(lease_s)

    async def state(self) -> ArmState:
        """Return the state now; waits at most for as long as a state is valid."""
        try:
            snapshot = await self._link.snapshot()
        except ArmFault as fault:
            return ArmState(None, None, None, None, self._link.fault or fault)
        if snapshot.age_s > self._settings.stale_after_s:
            stale = ArmFault(ArmCause.STALE, messages.STATE_OLD(age_s=snapshot.age_s))
            return ArmState(snapshot.age_s, None, None, None, self._link.fault or stale)
        moving = _moves(snapshot)
        at = None if moving else self._place(snapshot.joints_rad)
        return ArmState(snapshot.age_s, snapshot.joints_rad, moving, at, self._link.fault)

    async def move_to(self, pose: PoseName) -> None:
        """Move to a pose and return when it is reached; at once where the arm is there already.

        Raises:
            ArmFault: the arm is not ready, cannot move there, was stopped, or did not arrive.
        """
        where = messages.POSE(name=pose)
        async with self._one_way(where) as snapshot:
            known = (self._link.attachment, pose)
            target = self._settings.poses.joints_rad(pose)
            if known not in self._reachable:
                await self._require_reachable(target, where)
                self._reachable.add(known)
            straight = pose == "nest" or self._on_nest_way(snapshot.joints_rad)
            if _rests(snapshot) and _near(snapshot.joints_rad, target, BESIDE_WITHIN_RAD):
                return  # there already: a motion over no way costs two exchanges with the controller
            await self._go(target, where, self._settings.reached_tolerance_rad, straight=straight)

    async def move_beside_nest(self, offset_mm: Position) -> None:
        """Move straight to the nest plus an offset along the tool's axes, at most as long as the settings allow.

        Raises:
            ArmFault: the arm is not ready, may not move there, was stopped, or did not arrive.
        """
        most_mm, where = self._settings.centring.most_mm, messages.POSE_BESIDE_NEST()
        x_mm, y_mm, z_mm = offset_mm
        if math.hypot(*offset_mm) > most_mm:
            too_long = messages.OFFSET_TOO_LONG(x_mm=x_mm, y_mm=y_mm, z_mm=z_mm, limit_mm=most_mm)
            raise ArmFault(ArmCause.UNREACHABLE, too_long)
        async with self._one_way(where):
            nest = self._settings.poses.joints_rad("nest")
            found = await self._link.order(Beside(joints_rad=nest, offset_mm=offset_mm))
            if found.output:
                raise await self._link.explain(found.output)
            if found.joints_rad is None:
                no_way = messages.NO_WAY_BESIDE_NEST(x_mm=x_mm, y_mm=y_mm, z_mm=z_mm)
                raise ArmFault(ArmCause.UNREACHABLE, no_way)
            await self._require_reachable(found.joints_rad, where)
            self._beside_rad = found.joints_rad
            await self._go(found.joints_rad, where, BESIDE_WITHIN_RAD, straight=True)

    async def stop(self) -> None:
        """See `Arm.stop`; a `move_to` that is under way ends."""
        self._stopped.set()
        snapshot = await self._fresh_enough()
        if self._link.lost is None and (snapshot is None or snapshot.runtime_state == PLAYING):
            await self._brake()
        deadline_s = time.monotonic() + self._settings.call_deadline_s
        while time.monotonic() < deadline_s:
            if self._link.lost is not None:
                raise self._link.lost.again()
            snapshot = await self._fresh_enough()
            if snapshot is not None and not _moves(snapshot):
                return
            await asyncio.sleep(POLL_S)
        raise ArmFault(ArmCause.DEADLINE, messages.NO_REST())

    async def confirm_protective_stop(self) -> None:
        """Leave the protective stop, which the controller refuses in its first 5 s, and make the arm ready again."""
        async with (
            self._recovering(messages.RECOVERY_PROTECTIVE_STOP()),
            dashboard(self._settings.host) as conversation,
        ):
            await _require_remote(conversation)
            while "PROTECTIVE_STOP" in await conversation.request("safetystatus"):
                await asyncio.sleep(max(RECOVERY_POLL_S, self._link.fault_since_s + UNLOCK_AFTER_S - time.monotonic()))
                await conversation.request("close safety popup")
                await conversation.request("unlock protective stop")
            await self._link.upload()

    async def power_on_and_release_brakes(self) -> None:
        """Power on, release the brakes and start the program; after a safety fault, restart the safety system first."""
        async with self._recovering(messages.RECOVERY_POWER()), dashboard(self._settings.host) as conversation:
            await _require_remote(conversation)
            status = await conversation.request("safetystatus")
            if "EMERGENCY_STOP" in status:
                raise ArmFault(ArmCause.EMERGENCY_STOP, messages.BUTTON_PRESSED())
            if "FAULT" in status or "VIOLATION" in status:
                await conversation.request("restart safety")
            while "RUNNING" not in (mode := await conversation.request("robotmode")):
                await conversation.request("close safety popup")
                if "POWER_OFF" in mode:
                    await conversation.request("power on")
                elif "IDLE" in mode:
                    await conversation.request("brake release")
                await asyncio.sleep(RECOVERY_POLL_S)
            await self._link.upload()

    async def upload_again(self) -> None:
        """Restart the program after it was stopped; a playing program does not change."""
        async with self._recovering(messages.RECOVERY_UPLOAD()):
            await self._link.upload()

    @contextlib.asynccontextmanager
    async def _recovering(self, what: Message) -> AsyncIterator[None]:
        limit_s = self._settings.recovery_deadline_s
        try:
            async with asyncio.timeout(limit_s):
                yield
        except TimeoutError as error:
            late = messages.RECOVERY_TOO_LONG(recovery=what, limit_s=limit_s)
            raise ArmFault(ArmCause.DEADLINE, late) from error

    async def _require_ready(self) -> Snapshot:
        if self._link.fault is not None:
            raise self._link.fault.again()
        if not self._link.healthy:
            raise ArmFault(ArmCause.UNHEALTHY, messages.UNHEALTHY())
        snapshot = await self._link.snapshot()
        if snapshot.age_s > self._settings.stale_after_s:
            raise ArmFault(ArmCause.STALE, messages.STATE_OLD(age_s=snapshot.age_s))
        return snapshot

    @contextlib.asynccontextmanager
    async def _one_way(self, where: Message) -> AsyncIterator[Snapshot]:
        """Allow one motion at a time, of an arm that is ready."""
        if self._moving.locked():
            raise ArmFault(ArmCause.BUSY, messages.BUSY(pose=where))
        async with self._moving:
            self._stopped.clear()
            yield await self._require_ready()

    async def _require_reachable(self, target: Six, where: Message) -> None:
        outcome = await self._link.order(Reachable(joints_rad=target))
        if outcome.output or (await self._link.snapshot()).runtime_state != PLAYING:
            raise await self._link.explain(outcome.output)
        if not outcome.done:
            raise ArmFault(ArmCause.UNREACHABLE, messages.UNREACHABLE(pose=where))

    async def _go(self, target: Six, where: Message, tolerance_rad: float, *, straight: bool) -> None:
        if self._stopped.is_set():  # `stop` may have reported already that the arm is at rest
            raise ArmFault(ArmCause.STOPPED, messages.MOTION_STOPPED(pose=where))
        try:
            await self._begin(target, straight=straight)
            await self._arrive(target, where, tolerance_rad)
        except asyncio.CancelledError:
            # A second cancellation must not keep the arm from being stopped.
            with contextlib.suppress(ArmFault):
                await asyncio.shield(self._brake())
            raise

    async def _begin(self, target: Six, *, straight: bool) -> None:
        settings = self._settings
        request = Move(
            joints_rad=target,
            straight=straight,
            speed=settings.tool_speed_mm_s if straight else settings.joint_speed_rad_s,
            acceleration=settings.tool_acceleration_mm_s2 if straight else settings.joint_acceleration_rad_s2,
        )
        outcome = await self._link.order(request)
        if not outcome.done:
            raise await self._link.explain(outcome.output)

    async def _arrive(self, target: Six, where: Message, tolerance_rad: float) -> None:
        deadline_s = time.monotonic() + self._settings.move_deadline_s
        resting_since_s: float | None = None
        while time.monotonic() < deadline_s:
            if self._stopped.is_set():
                await self._brake()  # once more: the stop may have come just before the motion began
                raise ArmFault(ArmCause.STOPPED, messages.MOTION_STOPPED(pose=where))
            if self._link.fault is not None:
                raise self._link.fault.again()
            snapshot = await self._fresh_enough()
            near = snapshot is not None and _near(snapshot.joints_rad, target, tolerance_rad)
            if snapshot is None or _moves(snapshot):
                resting_since_s = None
            elif near:
                return
            elif resting_since_s is None:
                resting_since_s = time.monotonic()
            elif time.monotonic() - resting_since_s > SHORT_AFTER_S:
                raise ArmFault(ArmCause.NOT_REACHED, messages.NOT_REACHED(pose=where))
            await asyncio.sleep(ARRIVING_POLL_S if near else POLL_S)
        await self._brake()
        late = messages.TOO_LATE(pose=where, limit_s=self._settings.move_deadline_s)
        raise ArmFault(ArmCause.DEADLINE, late)

    async def _fresh_enough(self) -> Snapshot | None:
        try:
            snapshot = await self._link.snapshot()
        except ArmFault:
            return None
        return snapshot if snapshot.age_s <= self._settings.stale_after_s else None

    async def _brake(self) -> None:
        outcome = await self._link.order(Halt(deceleration_rad_s2=self._settings.stop_deceleration_rad_s2))
        if not outcome.done:
            raise await self._link.explain(outcome.output)

    def _place(self, joints_rad: Six) -> PoseName | None:
        poses, tolerance = self._settings.poses, self._settings.reached_tolerance_rad
        if self._beside_rad is not None and _near(joints_rad, self._beside_rad, tolerance):
            return "nest"
        return next((name for name in POSES if _near(joints_rad, poses.joints_rad(name), tolerance)), None)

    def _on_nest_way(self, joints_rad: Six) -> bool:
        """Return whether the arm is at the nest, or was stopped on the way between it and the place above it."""
        place, poses = self._place(joints_rad), self._settings.poses
        if place is not None:
            return place == "nest"
        spans = zip(joints_rad, poses.nest, poses.above_nest, strict=True)
        return all(min(ends) - NEST_WAY_RAD <= joint <= max(ends) + NEST_WAY_RAD for joint, *ends in spans)


async def _require_remote(conversation: DashboardConversation) -> None:
    if not (await conversation.facts()).remote:
        raise ArmFault(ArmCause.LOCAL_CONTROL, messages.LOCAL_CONTROL())


def _moves(snapshot: Snapshot) -> bool:
    # A program that was stopped leaves its report of a motion behind; one that is paused continues the motion.
    begun = snapshot.underway and snapshot.runtime_state not in STOPPED
    return begun or max(map(abs, snapshot.speeds_rad_s)) > AT_REST_RAD_S


def _rests(snapshot: Snapshot) -> bool:
    """Return whether the arm is at rest and would move if it were commanded to."""
    return snapshot.runtime_state == PLAYING and not _moves(snapshot)


def _near(joints_rad: Six, target_rad: Six, tolerance_rad: float) -> bool:
    return all(abs(a - b) <= tolerance_rad for a, b in zip(joints_rad, target_rad, strict=True))
