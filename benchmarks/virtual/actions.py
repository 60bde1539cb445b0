"""Simulated ends of the cycle's actions: the event of each, by the state of the devices and of the fruit."""

from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import Event
from station.inspection.second_press import needs_second_press
from station.runtime.cycle.runner import event_of
from station.vocabulary import Reason

from .inspection import RECIPE, ends_steps, judged, point
from .interpreter import WORDS, Interpreter


class Actions(Interpreter):
    """The end of each action, by the action's name."""

    def _open_jaws(self) -> Event:
        return Event.JAWS_OPEN

    _free_fruit = _open_jaws

    def _go_home(self) -> Event:
        return Event.HOME

    def _check_jaws(self) -> Event:
        if self.cell.jaws_open:
            return Event.JAWS_OPEN
        self._interrupt(Reason.REFERENCE_BAD)
        return Event.REFERENCE_BAD

    def _approach(self) -> Event:
        _, fault = self.cell.devices.request("camera", 0.01)
        if fault is not None:
            return event_of(fault)
        if self.cell.devices.trouble("camera") in {"garbage", "wrong"} and self.cell.rng.random() < 0.5:
            self._interrupt(Reason.REFERENCE_BAD)
            self.alarms.raise_(AlarmId.REFERENCE_BAD, WORDS)
            return Event.REFERENCE_BAD
        self.alarms.clear(AlarmId.REFERENCE_BAD)
        return Event.ARRIVED

    def _close_to_onset(self) -> Event:
        now, fruit = self._inspection, self.cell.fruit
        if fruit is None or not fruit.mm2_per_mm:
            self._interrupt(Reason.NO_CONTACT)
            return Event.NO_ONSET
        now.closings += 1
        if fruit.off_middle and now.closings == 1:
            return Event.OFF_MIDDLE
        now.onset_mm = fruit.width_mm + (9.0 if self.cell.devices.trouble("gripper") == "wrong" else 0.0)
        self._see(0.0)
        now.seen = 1
        return Event.ONSET_FOUND

    def _centre(self) -> Event:
        return Event.CENTRED

    def _close_step(self) -> Event:
        self._inspection.closed_steps += 1
        return Event.REACHED

    def _settle(self) -> Event:
        return Event.SETTLED

    def _capture(self) -> Event:
        now = self._inspection
        wrong_mm = 1.2 if self.cell.devices.trouble("gripper") == "wrong" else 0.0
        self._see(max(0.1, now.closed_steps * RECIPE.steps.step_mm - wrong_mm))
        return Event.LAST_CAPTURED if now.closed_steps >= RECIPE.steps.number else Event.CAPTURED

    def _see(self, closing_mm: float) -> None:
        now, fruit = self._inspection, self.cell.fruit
        now.captured.append(point(fruit, closing_mm, self.cell.devices.trouble("camera"), self.cell.rng))
        now.fruits.add(0 if fruit is None else fruit.number)

    def _measure(self) -> Event:
        now = self._inspection
        now.seen += 1
        if ends_steps(now.press()):
            return Event.EARLY_STOP
        if self._goes_on is not None:
            goes_on, self._goes_on = self._goes_on, None
            goes_on()
        return Event.MEASURED

    def _judge(self) -> Event:
        now = self._inspection
        now.verdict = judged(now.press())
        if len(now.earlier) + 1 < RECIPE.press.attempts and needs_second_press(now.verdict):
            now.earlier.append(now.press())
            now.let_go()
            return Event.PRESS_AGAIN
        now.outcome = now.verdict.outcome
        return Event.JUDGED_ACCEPT if now.outcome == "PASS" else Event.JUDGED_REJECT

    def _place_accept(self) -> Event:
        return Event.PLACED

    _place_reject = _place_accept

    def _recover_arm(self) -> Event:
        return Event.RECOVERED

    def _record_trigger(self) -> Event | None:
        pending = self._pending
        if pending is None:
            return None
        pending.now.sequence = self._records.begin(pending.record)
        return Event.TRIGGER_RECORDED

    def _record(self) -> Event:
        self._conclude(self._inspection)
        return Event.RECORDED
