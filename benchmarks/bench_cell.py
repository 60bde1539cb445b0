"""What the twin and the drivers cost together: CPU at 30 frames/s and 500 Hz RTDE, beside a bare ur-rtde client.

Run with `./run bench cell`. Writes `docs/cost.md`.
"""

import asyncio
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from station.devices.arm.ur import UrArm
from station.devices.camera.open import camera_from
from station.devices.gripper.robotiq import make_gripper
from station.settings.configuration import Configuration, load_configuration

ROOT = Path(__file__).resolve().parents[1]
HOST = "127.0.0.9"
MEASURED_S = 20.0
CYCLE_S = 0.02
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
    """A twin that listens where the configuration looks; returns once it runs."""
    command = [sys.executable, "-m", "station", "twin", "--config", str(configuration), "--console", "0"]
    twin = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    for line in twin.stdout or ():
        if line.startswith("running"):
            break
    return twin


async def load(configuration: Configuration, twin: psutil.Process) -> list[tuple[str, float, str]]:
    """Use all devices as a grip does, and give each process's share of a core."""
    camera, gripper = camera_from(configuration.camera), make_gripper(configuration.gripper)
    await camera.open()
    await gripper.activate()
    async with UrArm(configuration.arm) as arm:
        await arm.ready(15.0)
        driver = psutil.Process(arm.process_id)
        station = psutil.Process(os.getpid())
        before = [cpu_s(process) for process in (twin, driver, station)]
        began_s, frames, moves = time.monotonic(), 0, 0
        newest_s = began_s
        grip_at_s = began_s
        while (now_s := time.monotonic()) < began_s + MEASURED_S:
            arm.renew_health(2.0)
            await arm.state()
            frame = await camera.frame(newest_s, 1.0)
            newest_s, frames = frame.captured_s, frames + 1
            if now_s > grip_at_s:
                await gripper.move_to_width(40.0 - moves % 12, 20.0, 20.0)
                moves, grip_at_s = moves + 1, now_s + 0.4
        taken_s = time.monotonic() - began_s
        shares = [(cpu_s(p) - b) / taken_s for p, b in zip((twin, driver, station), before, strict=True)]
    await gripper.close()
    await camera.close()
    what = f"{frames / taken_s:.1f} frames/s, {moves / taken_s:.1f} width steps/s"
    return [
        ("twin: arm, gripper, fruit and sensor", shares[0], what),
        ("arm driver's process: ur-rtde at 500 Hz", shares[1], "control and receive interface"),
        ("station's side: camera, gripper and arm drivers", shares[2], what),
        ("together", sum(shares), ""),
    ]


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
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "station.yaml"
        file.write_text(
            f"arm: {{host: {HOST}}}\ngripper: {{urcap: {{host: {HOST}}}, modbus_rtu: {{host: {HOST}}}}}\n"
            "camera: {twin: {port: 49310}}\n"
        )
        twin = start_twin(file)
        try:
            rows = asyncio.run(load(load_configuration(file), psutil.Process(twin.pid)))
            rows.append(("peer: a bare ur-rtde receive interface at 500 Hz", bare_client(), "read every 20 ms"))
        finally:
            twin.terminate()
            twin.communicate()
    lines = [
        "# What the twin and the drivers cost",
        "",
        f"Written by `./run bench cell`: share of one core over {MEASURED_S:.0f} s, from the processes' own CPU times.",
        "The whole cell is in use: frames taken as they come, the arm's state with each, the gripper stepping.",
        "",
        "| process | share of a core | at |",
        "|---|---|---|",
        *(f"| {name} | {share:.2f} | {what} |" for name, share, what in rows),
        "",
    ]
    print("\n".join(lines))
    (ROOT / "docs" / "cost.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
