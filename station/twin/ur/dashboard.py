"""The dashboard server, port 29999: one line in, one line out.

Source of commands and answers: Universal Robots, "Dashboard Server e-Series". The refusal in local control and the
exact words about the first 5 s of a protective stop are unverified on hardware.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from station.twin.ur.safety import SafetyMode
from station.twin.ur.script import RuntimeState

if TYPE_CHECKING:  # the controller makes these itself
    from station.twin.ur.controller import UrController

PORT = 29999
BANNER = "Connected: Universal Robots Dashboard Server"
NOT_NOW = "Command is not allowed due to safety reasons"
TOO_EARLY = (
    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking"
)

_WITH_ARGUMENT = {
    "load installation": "File not found: {}",
    "load": "File not found: {}",
    "popup": "showing popup",
    "addtolog": "Added log message",
    "set operational mode": "",
    "generate flight report": "Flight Report generated with id: 1",
    "generate support file": "Completed successfully: {}",
}
"""Commands with an argument, and their answers with it; the longer of two that begin alike is first."""


class Dashboard:
    """The answers, without a socket."""

    def __init__(self, controller: "UrController") -> None:
        self._controller = controller
        self._operational_mode = "NONE"
        safety, script = controller.safety, controller.script
        self._questions: dict[str, Callable[[], str]] = {
            "polyscopeversion": lambda: f"URSoftware {controller.version_text} (Nov 01 2025)",
            "version": lambda: controller.version_text,
            "get serial number": lambda: controller.serial_number,
            "get robot model": lambda: "UR10",
            "is in remote control": lambda: str(safety.remote).lower(),
            "robotmode": lambda: f"Robotmode: {safety.robot_mode.name}",
            "safetymode": lambda: f"Safetymode: {safety.safety_mode.name}",
            "safetystatus": lambda: f"Safetystatus: {safety.safety_mode.name}",
            "running": lambda: f"Program running: {str(script.runtime_state is RuntimeState.PLAYING).lower()}",
            "programstate": lambda: f"{script.runtime_state.name} <unnamed>",
            "get loaded program": lambda: "No program loaded",
            "close popup": lambda: "closing popup",
            "isprogramsaved": lambda: "true <unnamed>",
            "get operational mode": lambda: self._operational_mode,
            "clear operational mode": lambda: self._set_operational_mode("NONE"),
            "quit": lambda: "Disconnected",
            "shutdown": lambda: "Shutting down",
            "help": lambda: f"Commands: {', '.join(sorted((*self._questions, *self._orders, *_WITH_ARGUMENT)))}",
        }
        self._orders: dict[str, Callable[[], str]] = {
            "stop": self._stop,
            "play": lambda: "Failed to execute: play",
            "pause": lambda: "Failed to execute: pause",
            "power on": self._power_on,
            "power off": self._power_off,
            "brake release": self._brake_release,
            "unlock protective stop": self._unlock,
            "close safety popup": lambda: "closing safety popup",
            "restart safety": self._restart_safety,
        }

    def answer(self, line: str) -> str:
        """Answer one line, and do what it orders."""
        command = " ".join(line.lower().split())
        if command in self._questions:
            return self._questions[command]()
        if (said := self._with_argument(line.strip())) is not None:
            return said
        if command not in self._orders:
            return f'could not understand: "{line.strip()}"'
        if not self._controller.safety.remote:
            return NOT_NOW
        return self._orders[command]()

    def _with_argument(self, line: str) -> str | None:
        """Return the answer to a command that has an argument; None for another one. Programs are not held here."""
        for command, answer in _WITH_ARGUMENT.items():
            argument = line[len(command) :].strip()
            if line.lower().startswith(command + " ") and argument:
                if command == "set operational mode":
                    return self._set_operational_mode(argument.upper())
                return answer.format(argument)
        return None

    def _set_operational_mode(self, mode: str) -> str:
        if mode == "NONE":
            self._operational_mode = mode
            return "operational mode is no longer controlled by Dashboard Server"
        if mode not in {"MANUAL", "AUTOMATIC"}:
            return f"Failed setting operational mode: {mode.lower()}"
        self._operational_mode = mode
        return f"Setting operational mode: {mode.lower()}"

    def _stop(self) -> str:
        self._controller.script.end("the dashboard stopped the program")
        return "Stopped"

    def _power_on(self) -> str:
        return "Powering on" if self._controller.safety.power_on(self._controller.clock.now_s()) else NOT_NOW

    def _power_off(self) -> str:
        self._controller.safety.power_off()
        return "Powering off"

    def _brake_release(self) -> str:
        return "Brake releasing" if self._controller.safety.release_brakes(self._controller.clock.now_s()) else NOT_NOW

    def _unlock(self) -> str:
        if self._controller.safety.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP:
            return NOT_NOW
        return (
            "Protective stop releasing" if self._controller.safety.unlock(self._controller.clock.now_s()) else TOO_EARLY
        )

    def _restart_safety(self) -> str:
        self._controller.safety.restart()
        return "Restarting safety"
