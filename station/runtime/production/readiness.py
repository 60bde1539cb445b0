"""Readiness for a trigger, or the reason against it: one sentence with the remedy."""

from station.channel.line import StationState
from station.channel.panel_maintenance import PartHealth
from station.inspection.cycle import WAITING_FOR_DEVICES
from station.inspection.states import STATES, State
from station.messages import readiness as messages
from station.messages.message import Message, message_of
from station.runtime.cycle.service import Service
from station.runtime.devices.manager import DeviceManager
from station.runtime.observability.health import Readiness
from station.runtime.observability.observability import Observability
from station.runtime.production.line_state import LineState
from station.runtime.production.lots import LotManager
from station.runtime.production.plc_commands import PRODUCTION, PlcCommands
from station.vocabulary import PackmlState, Refusal


class Interlock:
    """Interlock: checks everything that a trigger needs."""

    def __init__(
        self,
        service: Service,
        devices: DeviceManager,
        lots: LotManager,
        plc_commands: PlcCommands,
        line_state: LineState,
        observability: Observability,
    ) -> None:
        self._service, self._devices, self._lots = service, devices, lots
        self._plc_commands, self._line_state = plc_commands, line_state
        self._boot, self._liveness = observability.boot, observability.liveness

    def refusal(self) -> tuple[Refusal | None, Message | None]:
        """Return why no trigger is accepted, for the PLC and for a person; both None if one is."""
        service, facts = self._service, STATES[self._service.state]
        if service.ending:
            return Refusal.NOT_READY, messages.ENDING()
        if service.stopped_by_person and (facts.refusal is None or service.state is State.STOPPED):
            return Refusal.NOT_READY, messages.STOPPED_BY_PERSON()
        if facts.refusal is not None:
            return facts.refusal, self._trouble() or facts.reason
        return self._idle_refusal()

    def _idle_refusal(self) -> tuple[Refusal | None, Message | None]:
        service = self._service
        if stuck := self._liveness.stuck():
            parts = [messages.PART_AGE(part=name, age_s=age_s) for name, age_s in stuck.items()]
            return Refusal.NOT_READY, messages.NO_PROGRESS(parts=parts)
        if self._plc_commands.recipe_changing:
            return Refusal.RECIPE_CHANGING, messages.RECIPE_CHANGING()
        if service.active is None:
            return Refusal.NOT_READY, self._lots.no_recipe()
        if why := self._devices.calibration.refusal():
            return Refusal.NOT_READY, why
        if self._plc_commands.mode != PRODUCTION:
            return Refusal.NOT_READY, messages.NOT_PRODUCTION()
        return None, None

    def state(self) -> StationState:
        """Return the whole state, as the PLC interface gets it with every beat."""
        service = self._service
        refusal, why = self.refusal()
        snapshot = None if service.active is None else service.active.snapshot
        return StationState(
            boot=self._boot,
            healthy=not self._liveness.stuck(),
            ready=refusal is None,
            why_not_ready=why,
            packml_state=self._packml(),
            mode=self._plc_commands.mode,
            recipe_number=0 if snapshot is None else snapshot.number,
            recipe_checksum=0 if snapshot is None else snapshot.checksum,
            error_code=service.alarms.alarms.error_code,
            alarms=service.alarms.alarms.word,
            simulated=self._devices.simulated,
            registers_wanted=self._line_state.registers_wanted,
        )

    def _packml(self) -> PackmlState | None:
        """Return the state's own; STOPPING while an orderly end waits for what still runs."""
        facts = STATES[self._service.state]
        return PackmlState.STOPPING if self._service.ending and not facts.may_exit else facts.packml

    def readiness(self) -> Readiness:
        """Return the readiness for /readyz, with every dependency's age."""
        refusal, why = self.refusal()
        devices = [
            PartHealth(
                name=name,
                state="ok" if monitor.fault is None else "fault" if monitor.heard_s is not None else "unknown",
                age_s=monitor.age_s,
                detail=None if monitor.fault is None else message_of(monitor.fault),
                remedy=None if monitor.fault is None else messages.SEE_DEVICES(),
            )
            for name, monitor in self._devices.monitors.items()
        ]
        return Readiness(refusal is None, why, (*devices, self._records(), self._line()))

    def _records(self) -> PartHealth:
        fault, age_s = self._service.registry.fault, self._service.registry.records.status().last_write_age_s
        if fault is None:
            return PartHealth(name="records", state="ok", age_s=age_s)
        return PartHealth(name="records", state="fault", age_s=age_s, detail=fault.cause, remedy=fault.remedy)

    def _line(self) -> PartHealth:
        age_s = self._line_state.age_s
        if age_s is None:
            why, remedy = messages.PLC_NOT_HEARD(), messages.START_PLC()
            return PartHealth(name="plc", state="unknown", age_s=None, detail=why, remedy=remedy)
        if trouble := self._line_state.fault():
            return PartHealth(name="plc", state="fault", age_s=age_s, detail=trouble, remedy=messages.SEE_DETAIL())
        return PartHealth(name="plc", state="ok", age_s=age_s)

    def _trouble(self) -> Message | None:
        if self._service.state not in WAITING_FOR_DEVICES:
            return None
        fault = next(iter(self._devices.faults.values()), self._service.registry.fault)
        return None if fault is None else message_of(fault)
