"""CPU of the emulated controller and of the arm's driver, beside bare ur-rtde on the same controller.

Writes its table into docs/arm.md.
"""

import asyncio
import multiprocessing
import sys
import time
from collections.abc import Callable
from multiprocessing.context import SpawnProcess
from pathlib import Path

import psutil

from station.devices.arm.ur import UrArm
from station.settings.arm import ArmSettings
from station.twin.clock import SteadyClock
from station.twin.ur.controller import UrController, arm_faults

HOST = "127.7.0.2"
MEASURE_S = 6.0
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "arm.md"
BEGIN, END = "<!-- bench_arm begins -->", "<!-- bench_arm ends -->"
ROUND_TRIPS = 200

Row = tuple[str, dict[str, float]]
"""What was measured, and each process's CPU in per cent of a core."""


def run_controller() -> None:
    """The emulated controller, alone in its process."""

    async def serve() -> None:
        await UrController(HOST, SteadyClock(), arm_faults()).start()
        await asyncio.Event().wait()

    asyncio.run(serve())


def run_bare_receive(frequency_hz: float) -> None:
    """ur-rtde's receive interface, read once a cycle: the peer."""
    from rtde_receive import RTDEReceiveInterface  # noqa: PLC0415

    receive = RTDEReceiveInterface(HOST, frequency_hz, ["timestamp", "actual_q", "actual_qd", "actual_TCP_pose"])
    while True:
        receive.getActualQ()
        time.sleep(1 / frequency_hz)


def run_bare_control(durations_s: "multiprocessing.Queue[float]") -> None:
    """ur-rtde's control interface: the time of one blocking call."""
    from rtde_control import RTDEControlInterface  # noqa: PLC0415

    control = RTDEControlInterface(HOST)
    began_s = time.perf_counter()
    for _ in range(ROUND_TRIPS):
        control.isSteady()
    durations_s.put((time.perf_counter() - began_s) / ROUND_TRIPS)
    control.disconnect()


def share(processes: dict[str, psutil.Process], duration_s: float) -> dict[str, float]:
    """CPU of each process in per cent of a core over a time."""
    before = {name: sum(process.cpu_times()[:2]) for name, process in processes.items()}
    time.sleep(duration_s)
    return {
        name: 100 * (sum(process.cpu_times()[:2]) - before[name]) / duration_s for name, process in processes.items()
    }


def started(target: Callable[..., None], *arguments: object) -> SpawnProcess:
    """A process that is running."""
    process = multiprocessing.get_context("spawn").Process(target=target, args=arguments, daemon=True)
    process.start()
    return process


async def with_driver(controller: psutil.Process, frequency_hz: float) -> tuple[list[Row], list[float]]:
    """CPU of controller, driver and its process, at rest and on the move; durations of `state()` in s, in order."""
    settings = ArmSettings(host=HOST, frequency_hz=frequency_hz, joint_speed_rad_s=0.3)
    async with UrArm(settings) as arm:
        await arm.ready(20.0)
        arm.renew_health(600.0)
        assert arm.process_id is not None
        processes = {
            "controller": controller,
            "driver": psutil.Process(),
            "its process": psutil.Process(arm.process_id),
        }
        rows = [(f"driver at {frequency_hz:g} Hz, arm at rest", await asyncio.to_thread(share, processes, MEASURE_S))]

        async def drive() -> None:
            while True:
                for pose in ("accept", "reject"):
                    await arm.move_to(pose)

        driving = asyncio.create_task(drive())
        rows.append(
            (f"driver at {frequency_hz:g} Hz, arm moving", await asyncio.to_thread(share, processes, MEASURE_S))
        )
        driving.cancel()
        await asyncio.gather(driving, return_exceptions=True)
        durations = []
        for _ in range(ROUND_TRIPS):
            began_s = time.perf_counter()
            await arm.state()
            durations.append(time.perf_counter() - began_s)
        return rows, sorted(durations)


def bare_receive(controller: psutil.Process) -> Row:
    """CPU of controller and of a bare receive loop."""
    peer = started(run_bare_receive, 500.0)
    time.sleep(2.0)
    assert peer.pid is not None
    cost = share({"controller": controller, "its process": psutil.Process(peer.pid)}, MEASURE_S)
    peer.kill()
    peer.join()
    return "bare ur-rtde receive loop at 500 Hz", cost


def bare_control() -> float:
    """Seconds of one blocking call of bare ur-rtde."""
    durations_s: multiprocessing.Queue[float] = multiprocessing.get_context("spawn").Queue()
    peer = started(run_bare_control, durations_s)
    duration_s = durations_s.get(timeout=30)
    peer.join()
    return duration_s


def table(rows: list[Row]) -> str:
    """The rows as Markdown, in per cent of one core."""
    lines = ["| | controller | driver | ur-rtde's process |", "|---|---|---|---|"]
    for name, cost in rows:
        cells = (f"{cost[key]:.1f} %" if key in cost else "" for key in ("controller", "driver", "its process"))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> int:
    """Measure and write the table."""
    controller = started(run_controller)
    time.sleep(2.0)
    assert controller.pid is not None
    server = psutil.Process(controller.pid)
    rows = [("no client connected", share({"controller": server}, MEASURE_S))]
    rows.append(bare_receive(server))
    at_500, durations_s = asyncio.run(with_driver(server, 500.0))
    at_125, _ = asyncio.run(with_driver(server, 125.0))
    rows += at_500 + at_125
    blocking_s = bare_control()
    controller.kill()
    controller.join()
    written = (
        f"{table(rows)}\n\n"
        f"The driver's `state()` takes {1000 * durations_s[ROUND_TRIPS // 2]:.2f} ms in the median and "
        f"{1000 * durations_s[-1]:.2f} ms at worst of {ROUND_TRIPS}; one blocking call of bare ur-rtde "
        f"{1000 * blocking_s:.2f} ms. Measured for {MEASURE_S:g} s each with Python {sys.version.split()[0]} on "
        f"{psutil.cpu_count()} cores."
    )
    print(written)
    head, _, rest = DOCUMENT.read_text().partition(BEGIN)
    _, _, tail = rest.partition(END)
    DOCUMENT.write_text(f"{head}{BEGIN}\n{written}\n{END}{tail}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
