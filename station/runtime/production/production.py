"""The parts that run production, for those who serve, watch or maintain it."""

from dataclasses import dataclass

from station.runtime.cycle.service import Service
from station.runtime.devices.manager import DeviceManager
from station.runtime.production.line_state import LineState
from station.runtime.production.lots import LotManager
from station.runtime.production.plc_commands import PlcCommands
from station.runtime.production.readiness import Interlock
from station.runtime.recipes.active import ActiveRecipes


@dataclass(frozen=True)
class Production:
    """Cycle, devices, recipes, lots, commands, line state and interlock of one station."""

    service: Service
    devices: DeviceManager
    recipes: ActiveRecipes
    lots: LotManager
    plc_commands: PlcCommands
    line_state: LineState
    interlock: Interlock
