"""CPU of the twin and the drivers together, at 30 frames/s and 500 Hz RTDE, beside a bare ur-rtde client.

Run with `./run bench cell`. Writes `docs/cost.md`.
"""

import asyncio
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import psutil

from station.devices.arm.ur import UrArm
from station.devices.camera.open import camera_from
from station.devices.gripper.robotiq import make_gripper
from station.memory import keep_freed_memory
from station.settings.configuration import Configuration, load_configuration

ROOT = Path(__file__).resolve().parents[1]
HOST = "127.0.0.9"
MEASURED_S = 20.0
CYCLE_S = 0.02
LOOK_S = 0.1
STEP_S = 0.35
"""A width step of a grip with its move."""
OPEN_MM, STEPS = 38.0, 14
"""The twin's first strawberry is 36.5 mm wide: two steps before it, twelve into it."""
BARE = f"""
import time
from rtde_receive import RTDEReceiveInterface
receive = RTDEReceiveInterface("{HOST}", 500.0)
print("ready", flush=True)
end = time.monotonic() + {MEASURED_S}
while time.monotonic() < end:
    receive.getActualQ()
    time.sleep({CYCLE_S})
"""


def cpu_s(process: psutil.Process) -> float:
    """User and system time of one process, s."""
    times = process.cpu_times()
    return times.user + times.system


def start_twin(configuration: Path) -> subprocess.Popen[str]:
    """A twin that listens at the configuration's addresses; returns once it runs."""
    command = [sys.executable, "-m", "station", "twin", "--config", str(configuration), "--console", "0"]
    twin = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    for line in twin.stdout or ():
        if line.startswith("running"):
            break
    return twin


class Shares(NamedTuple):
    """Shares of a core that each process took, and the rates of frames and of the gripper's steps or reads."""

    twin: float
    arm: float
    station: float
    frames_per_s: float
    steps_per_s: float


async def measure(configuration: Configuration, twin: psutil.Process, *, gripping: bool) -> Shares:
    """Take every frame, and the arm's state with it; look at the gripper, or squeeze the fruit in the nest by steps."""
    camera, gripper = camera_from(configuration.camera), make_gripper(configuration.gripper)
    await camera.open()
    await gripper.activate()
    async with UrArm(configuration.arm) as arm:
        await arm.ready(15.0)
        arm.renew_health(30.0)
        if gripping:
            await gripper.move_to_width(OPEN_MM, 20.0, 20.0)
            await arm.move_to("above_nest")
            await arm.move_to("nest")
        processes = [twin, psutil.Process(arm.process_id), psutil.Process(os.getpid())]
        before = [cpu_s(process) for process in processes]
        began_s = time.monotonic()
        end_s = began_s + MEASURED_S

        async def use_gripper() -> int:
            steps = 0
            while time.monotonic() < end_s:
                if gripping:
                    await gripper.move_to_width(OPEN_MM - steps % STEPS, 20.0, 20.0)
                else:
                    await gripper.read()
                steps += 1
                await asyncio.sleep(STEP_S if gripping else LOOK_S)
            return steps

        async def use_camera_and_arm() -> int:
            frames, newest_s = 0, began_s
            while time.monotonic() < end_s:
                arm.renew_health(2.0)
                await arm.state()
                newest_s, frames = (await camera.frame(newest_s, 1.0)).captured_s, frames + 1
            return frames

        steps, frames = await asyncio.gather(use_gripper(), use_camera_and_arm())
        taken_s = time.monotonic() - began_s
        twin_share, arm_share, station_share = (
            (cpu_s(process) - earlier_s) / taken_s for process, earlier_s in zip(processes, before, strict=True)
        )
    await gripper.close()
    await camera.close()
    return Shares(twin_share, arm_share, station_share, frames / taken_s, steps / taken_s)


def bare_client() -> float:
    """The share of a core that ur-rtde's receive interface alone takes, read as often."""
    client = subprocess.Popen([sys.executable, "-c", BARE], stdout=subprocess.PIPE, text=True)
    process = psutil.Process(client.pid)
    assert client.stdout is not None
    client.stdout.readline()
    before_s, began_s = cpu_s(process), time.monotonic()
    time.sleep(MEASURED_S * 0.8)
    share = (cpu_s(process) - before_s) / (time.monotonic() - began_s)
    client.communicate()
    return share


def main() -> None:
    """Measure, print and write the table."""
    keep_freed_memory()  # as `station service` does
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "station.yaml"
        file.write_text(
            f"arm: {{host: {HOST}}}\ngripper: {{urcap: {{host: {HOST}}}, modbus_rtu: {{host: {HOST}}}}}\n"
            "camera: {twin: {port: 49310}}\n"
        )
        twin = start_twin(file)
        try:
            process, configuration = psutil.Process(twin.pid), load_configuration(file)
            loads = [os.getloadavg()[0]]
            ready = asyncio.run(measure(configuration, process, gripping=False))
            gripping = asyncio.run(measure(configuration, process, gripping=True))
            bare = bare_client()
            loads.append(os.getloadavg()[0])
        finally:
            twin.terminate()
            twin.communicate()
    lines = [
        "# Processor load of the twin and the drivers",
        "",
        f"Written by `./run bench cell`: share of one core over {MEASURED_S:.0f} s, from the processes' own CPU times.",
        "Every frame is taken, the arm's state with each, RTDE at 500 Hz. Ready: the gripper is polled ten times a",
        "second. Gripping: in the nest a strawberry is squeezed by steps of 1 mm over and over, which no cycle does.",
        "",
        f"Load of the machine while it was measured, on {os.cpu_count()} cores: {min(loads):.1f} to {max(loads):.1f};",
        "other programs share its caches and raise these figures.",
        "",
        "| process | ready | gripping |",
        "|---|---|---|",
        f"| twin: arm, gripper, fruit and sensor | {ready.twin:.2f} | {gripping.twin:.2f} |",
        f"| the arm driver's process, with ur-rtde | {ready.arm:.2f} | {gripping.arm:.2f} |",
        f"| station: camera, gripper and arm drivers | {ready.station:.2f} | {gripping.station:.2f} |",
        f"| together | {sum(ready[:3]):.2f} | {sum(gripping[:3]):.2f} |",
        f"| frames/s | {ready.frames_per_s:.1f} | {gripping.frames_per_s:.1f} |",
        f"| polls or steps of the gripper a second | {ready.steps_per_s:.1f} | {gripping.steps_per_s:.1f} |",
        f"| peer: ur-rtde's receive interface alone at 500 Hz, read every 20 ms | {bare:.2f} | |",
        "",
    ]
    print("\n".join(lines))
    (ROOT / "docs" / "cost.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
