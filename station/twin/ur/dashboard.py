"""The dashboard server, port 29999: one line in, one line out.

Source of commands and answers: Universal Robots, "Dashboard Server e-Series". The refusal in local control and the
exact words about the first 5 s of a protective stop are unverified on hardware.
"""

from collections.abc import Callable

from station.twin.ur.interface import Controller
from station.twin.ur.safety import SafetyMode
from station.twin.ur.script import RuntimeState

PORT = 29999
BANNER = "Connected: Universal Robots Dashboard Server"
NOT_NOW = "Command is not allowed due to safety reasons"
TOO_EARLY = (
    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking"
)


class Dashboard:
    """The answers, without a socket."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
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
        if command.startswith(("popup ", "addtolog ")):
            return "showing popup" if command.startswith("popup") else "Added log message"
        if command not in self._orders:
            return f'could not understand: "{line.strip()}"'
        if not self._controller.safety.remote:
            return NOT_NOW
        return self._orders[command]()

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
