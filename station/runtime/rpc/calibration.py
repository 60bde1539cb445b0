"""Calibration and verification with the ball from the panel, in manual mode, guided by a person."""

import asyncio
import contextlib
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from station.calibration.calibration_procedure import CalibrationProcedure
from station.calibration.checks import check_name, failed_check
from station.calibration.model import Calibration, Verification
from station.calibration.report import calibration_files, verification_files
from station.calibration.rig import Place, Progress, Unit
from station.calibration.store import CalibrationStore, Prepared
from station.calibration.verification_procedure import VerificationProcedure
from station.channel.panel import Actor
from station.channel.panel_maintenance import (
    CalibrationRunView,
    CalibrationState,
    CalibrationView,
    CheckView,
    ContinueCalibrationRun,
    EndCalibrationRun,
    GetCalibration,
    NoteGelChange,
    RunStep,
    StartCalibrationRun,
)
from station.channel.server import Handlers
from station.channel.worker import PanelWorker
from station.errors import BadInputError, StationError
from station.inspection.cycle import STOPPED_FOR_A_PERSON
from station.inspection.states import STATES, State
from station.messages import calibration as messages
from station.messages.maintenance import UNDER_WAY
from station.messages.message import Message, joined, message_of
from station.messages.operation import internal_fault
from station.records.audit import AuditEntry, append_audit
from station.records.records import Records
from station.runtime.devices.calibration_rig import CalibrationRig, Refusals
from station.runtime.devices.gel_change import store_gel_change
from station.runtime.observability.audit_logger import AuditLogger, calibration_entry, verification_entry
from station.runtime.production.production import Production
from station.runtime.rpc.maintenance import PanelMaintenance
from station.settings.configuration import Configuration
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe

log = logging.getLogger(__name__)

ANSWERED_S = 600.0
"""Longest wait for a person to lay the ball."""
_MOVES_IN = {State.IDLE, State.STOPPED}
"""States of the cycle in which a run may move something; in any other one something has happened since it began."""
_PICTURES = ("area.png", "field.png")
_NAMES = {"calibration": messages.A_CALIBRATION, "verification": messages.A_VERIFICATION}


@dataclass(slots=True)
class _Run:
    """One run, under way or over."""

    kind: Literal["calibration", "verification"]
    actor: Actor
    state: Literal["running", "waiting", "passed", "failed", "ended"] = "running"
    request: Message | None = None
    steps: dict[str, RunStep] = field(default_factory=dict)
    result: Message | None = None
    laid: asyncio.Event = field(default_factory=asyncio.Event)
    task: asyncio.Task[None] | None = None
    cancelled: bool = False

    @property
    def open(self) -> bool:
        return self.state in {"running", "waiting"}


class PanelCalibration:
    """Requests about the calibration, and runs of the procedures of `station.calibration`.

    Args:
        worker: reads and writes files in its thread.
        maintenance: returns why nobody may work, or move anything, by hand now.
    """

    def __init__(
        self,
        configuration: Configuration,
        production: Production,
        records: Records,
        audit: AuditLogger,
        worker: PanelWorker,
        maintenance: PanelMaintenance,
    ) -> None:
        self._site, self._service, self._devices = configuration, production.service, production.devices
        self._records, self._audit, self._worker, self._maintenance = records, audit, worker, maintenance
        self._store = CalibrationStore(configuration.home)
        self._run: _Run | None = None
        self.handlers: Handlers = {
            GetCalibration: self.state,
            StartCalibrationRun: self.begin,
            ContinueCalibrationRun: self.go_on,
            EndCalibrationRun: self.end,
            NoteGelChange: self.note_gel_change,
        }

    async def close(self) -> None:
        """Cancel the run under way; the jaws open. Idempotent."""
        run = self._run
        if run is not None and run.task is not None:
            if not run.cancelled:  # a second one would stop the jaws that open
                run.cancelled = True
                run.task.cancel()
            await asyncio.gather(run.task, return_exceptions=True)

    async def state(self, _request: GetCalibration) -> CalibrationState:
        """Return the sensor's calibration state."""
        serial = self._devices.cell.camera.description.serial

        def read() -> tuple[Calibration | None, Verification | None]:
            calibration = self._devices.calibration.calibration
            return calibration, None if calibration is None else self._store.last_verification(calibration)

        calibration, verification = await self._worker.do(read)
        figures, settings = self._devices.calibration.figures, self._site.calibration
        return CalibrationState(
            serial=serial,
            in_use=self._devices.calibration.in_force.words,
            calibration=None if calibration is None else self._view(calibration, calibration.summary(), passed=True),
            verification=None if verification is None else self._verification_view(verification),
            age_s=figures.age_s,
            verification_age_s=figures.verification_age_s,
            oldest_days=settings.oldest_days,
            verify_every_h=settings.verify_every_h,
            trouble=self._devices.calibration.refusal() or self._devices.calibration.alarm_detail(),
            ball_mm=settings.ball_mm,
            run=None if self._run is None else _run_view(self._run),
            run_refused=self._run_refusal(serial),
            gel_change_refused=self._gel_change_refusal(serial),
        )

    async def begin(self, request: StartCalibrationRun) -> CalibrationRunView:
        """Start a run; the gripper closes on the ball."""
        if why := self._run_refusal(self._devices.cell.camera.description.serial):
            raise StationError(why)
        run = self._run = _Run(request.kind, request.actor)
        self._note(request.actor, "calibration.begun")
        undisturbed = contextlib.ExitStack()
        undisturbed.enter_context(self._service.manual(_NAMES[request.kind](), self.close))
        self._devices.use(by_inspection=True)
        undisturbed.callback(lambda: self._devices.use(by_inspection=False))
        run.task = asyncio.create_task(self._run_procedure(run, request), name=f"{request.kind} at the panel")
        run.task.add_done_callback(lambda _: undisturbed.close())
        return _run_view(run)

    async def go_on(self, _request: ContinueCalibrationRun) -> CalibrationRunView:
        """Continue after the ball was laid."""
        run = self._run
        if run is None or run.state != "waiting":
            raise BadInputError(messages.NOT_WAITING())
        if why := self._motion_refusal():
            raise StationError(why)
        run.state, run.request = "running", None
        run.laid.set()
        return _run_view(run)

    async def end(self, request: EndCalibrationRun) -> CalibrationRunView:
        """Cancel the run."""
        run = self._run
        if run is None:
            raise BadInputError(messages.NOT_BEGUN())
        if run.open:
            self._note(request.actor, "calibration.called_off")
            await self.close()
        return _run_view(run)

    async def note_gel_change(self, request: NoteGelChange) -> CalibrationState:
        """Take the sensor's calibrations out of force."""
        serial, actor = self._devices.cell.camera.description.serial, request.actor
        if why := self._gel_change_refusal(serial):
            raise StationError(why)
        with self._service.manual(messages.A_GEL_CHANGE(), self.close):  # until it is stored no fruit is accepted
            await self._records.change_to_end(
                lambda connection: store_gel_change(connection, self._site.home, serial, actor.who, actor.role)
            )
        return await self.state(GetCalibration())

    def _run_refusal(self, serial: str) -> Message | None:
        return self._unavailable(serial) or self._maintenance.refusal() or self._motion_refusal()

    def _gel_change_refusal(self, serial: str) -> Message | None:
        # Also with the cell made safe, as for the change itself: nothing moves.
        return self._unavailable(serial) or self._maintenance.work_refusal()

    def _unavailable(self, serial: str) -> Message | None:
        if activity := self._service.manual_activity:
            return UNDER_WAY(activity=activity)
        return None if serial else messages.NO_SENSOR()

    def _motion_refusal(self) -> Message | None:
        """Return why a run may move nothing now but jaws that open."""
        state = self._service.runner.bound_for
        return None if state in _MOVES_IN else STATES[state].activity

    def _opening_refusal(self) -> Message | None:
        """Return why not even the jaws may open now."""
        state = self._service.runner.bound_for
        return STATES[state].activity if state in STOPPED_FOR_A_PERSON else None

    async def _run_procedure(self, run: _Run, request: StartCalibrationRun) -> None:
        try:
            await self._devices.restore_light()
            result = await (self._calibrate(run, request) if run.kind == "calibration" else self._verify(run))
        except asyncio.CancelledError:
            run.state, run.result = "ended", messages.CALLED_OFF()
            raise
        except (StationError, ValueError) as error:
            run.state, run.result = "failed", message_of(error)
            if isinstance(error, StationError):
                self._devices.report_fault(error)
        except Exception as error:  # the page must not show for ever that it runs
            log.exception("the %s at the panel", run.kind)
            run.state, run.result = "failed", internal_fault(error)
        else:
            run.state, run.result = ("passed", None) if result is None else ("failed", result)
        finally:
            run.request = None

    def _rig(self, run: _Run, recipe: Recipe) -> CalibrationRig:
        return CalibrationRig(
            self._devices.cell,
            recipe,
            lambda place: self._lay(run, place),
            lambda: self._devices.activate_if_safe(lambda: self._motion_refusal() is None),
            self._site.service.patience,
            Refusals(self._motion_refusal, self._opening_refusal),
        )

    async def _calibrate(self, run: _Run, request: StartCalibrationRun) -> None:
        recipe = await self._worker.do(lambda: find_recipe(self._site.calibration.recipe, self._site.recipes_folder))
        rig = self._rig(run, recipe)
        draft = await CalibrationProcedure(
            rig,
            self._unit(),
            recipe,
            self._site.calibration,
            [Place(x_mm, y_mm) for x_mm, y_mm in request.places],
            run.actor.who,
            version("fruit-station"),
            lambda progress: _note_step(run, progress),
        ).run()
        before, new = self._store.current(draft.calibration.serial), draft.calibration
        files = await asyncio.to_thread(calibration_files, draft)
        entry = calibration_entry(
            run.actor.who, "", f"sensor {new.serial}", None if before is None else before.id, new.id
        )
        await self._put_in_force(entry, lambda: self._store.prepare_calibration(new, files))

    async def _verify(self, run: _Run) -> Message | None:
        calibration = self._devices.calibration.calibration
        if calibration is None:
            raise BadInputError(messages.MISSING())
        recipe = await self._worker.do(lambda: find_recipe(self._site.calibration.recipe, self._site.recipes_folder))
        golden, presses = await self._worker.do(
            lambda: (self._store.golden(calibration), self._store.presses(calibration))
        )
        rig = self._rig(run, recipe)
        verified = await VerificationProcedure(
            rig,
            recipe,
            self._site.calibration,
            calibration,
            golden,
            presses,
            run.actor.who,
            lambda progress: _note_step(run, progress),
        ).run()
        files = await asyncio.to_thread(verification_files, verified, calibration)
        made = verified.verification
        entry = verification_entry(
            run.actor.who, f"sensor {calibration.serial}", calibration.id, made.id, passed=made.passed
        )
        await self._put_in_force(entry, lambda: self._store.prepare_verification(made, files))
        failed = [failed_check(check) for check in made.checks if not check.passed]
        return joined(failed) if failed else None

    async def _put_in_force(self, entry: AuditEntry, prepare: Callable[[], Prepared]) -> None:
        """Put a record in force together with its audit entry; once started it completes, also when cancelled.

        Raises:
            StationError: neither is stored.
        """

        async def store() -> None:
            prepared = await asyncio.to_thread(prepare)
            try:
                await self._records.change_to_end(
                    lambda connection: (append_audit(connection, entry), prepared.put_in_force())
                )
            except StationError:
                await asyncio.to_thread(prepared.discard)
                raise

        storing = asyncio.create_task(store(), name="storing the record of a run")
        while not storing.done():
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.wait({storing})
        storing.result()

    async def _lay(self, run: _Run, place: Place) -> None:
        """Request the ball from the person, and wait until it is in place."""
        run.laid.clear()
        run.state = "waiting"
        run.request = messages.LAY_BALL(right_mm=place.x_mm, down_mm=place.y_mm)
        try:
            async with asyncio.timeout(ANSWERED_S):
                await run.laid.wait()
        except TimeoutError:
            raise StationError(messages.BALL_LATE(limit_min=ANSWERED_S / 60)) from None

    def _unit(self) -> Unit:
        description = self._devices.cell.camera.description
        return Unit(description.serial, description.name, simulated=self._site.camera.driver != "digit")

    def _note(self, actor: Actor, action: str) -> None:
        kind = self._run.kind if self._run is not None else "run"
        self._audit.log(AuditEntry(actor.who, actor.role, action, kind))

    def _verification_view(self, made: Verification) -> CalibrationView:
        ratio = None if made.area_ratio is None else messages.RATIO_OF_BALL(percent=100 * made.area_ratio)
        return self._view(made, ratio, passed=made.passed)

    def _view(self, made: Calibration | Verification, words: Message | None, *, passed: bool) -> CalibrationView:
        return CalibrationView(
            serial=made.serial,
            id=made.id,
            made_utc_ms=round(1000 * made.made_at.timestamp()),
            operator=made.operator,
            words=words,
            passed=passed,
            checks=_check_views(made),
            folder=str(self._store.folder(made).absolute()),
            pictures=_files_in(self._store.folder(made)),
        )


def _note_step(run: _Run, progress: Progress) -> None:
    run.steps[progress.title.id] = RunStep(**progress._asdict())


def _run_view(run: _Run) -> CalibrationRunView:
    return CalibrationRunView(
        kind=run.kind, state=run.state, request=run.request, steps=tuple(run.steps.values()), result=run.result
    )


def _check_views(made: Calibration | Verification) -> tuple[CheckView, ...]:
    return tuple(
        CheckView(
            name=check_name(check.name),
            passed=check.passed,
            found=check.found,
            expected=check.expected,
            remedy=check.remedy,
        )
        for check in made.checks
    )


def _files_in(folder: Path) -> tuple[str, ...]:
    with contextlib.suppress(OSError):
        return tuple(name for name in _PICTURES if (folder / name).is_file())
    return ()
