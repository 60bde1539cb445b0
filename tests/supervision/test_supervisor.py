"""Real processes under the supervisor: started in order, restarted, given up, ended."""

import asyncio
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import psutil
import pytest

from station.supervision import restarts, supervisor
from station.supervision.notify import notify
from station.supervision.programs import station_programs
from station.supervision.restarts import RESTARTS_VARIABLE
from station.supervision.supervisor import RESTARTS, SupervisionError


def environment(pid):
    """Return the environment that a process was started with."""
    return psutil.Process(pid).environ()


async def end(_supervisor, ended):
    ended.set()


def test_programs_start_in_order_and_end_in_reverse(bench):
    bench.run([bench.program("first"), bench.program("second")], end)
    assert bench.log() == ["start first", "start second", "end second", "end first"]


def test_a_program_that_outlives_another_ends_right_after_it(bench):
    names = ("twin", "service", "plc", "pages")
    programs = [replace(bench.program(name), outlives="service" if name == "plc" else None) for name in names]
    bench.run(programs, end)
    assert bench.log() == [*(f"start {name}" for name in names), *("end pages", "end service", "end plc", "end twin")]


def test_the_service_may_clean_up_as_long_as_its_site_says_and_the_plc_interface_outlives_it():
    programs = {each.name: each for each in station_programs(None, clean_up_s=60.0)}
    assert programs["service"].stop_limit_s > 60.0
    assert programs["plc"].outlives == "service"


def test_a_start_that_asks_for_more_time_gets_it_from_the_supervisor_and_from_systemd(bench, monkeypatch):
    """As the first start of a release does, which migrates the records of years."""
    notified: list[str] = []
    passed_s = 0.0
    monotonic = time.monotonic

    def on_notify(message):
        nonlocal passed_s
        notified.append(message)
        if message.startswith("EXTEND_TIMEOUT_USEC="):
            passed_s = 40.0  # twice the limit of a start
            (bench.folder / "only.go").touch()

    monkeypatch.setattr(supervisor, "notify", on_notify)
    monkeypatch.setattr(supervisor.time, "monotonic", lambda: monotonic() + passed_s)
    bench.run([bench.program("only", "slow")], end)
    assert bench.ready
    assert notified[0] == "EXTEND_TIMEOUT_USEC=60000000"


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_what_dies_is_started_again_and_the_others_go_on(bench, until, number, monkeypatch):
    async def kill(supervisor, ended):
        os.kill(bench.pids("second")[0], number)
        await until(lambda: len(bench.pids("second")) == 2)
        monkeypatch.setenv(RESTARTS_VARIABLE, environment(bench.pids("first")[0])[RESTARTS_VARIABLE])
        assert [(name, counts.total, counts.within(60)) for name, counts in restarts.read().items()] == [
            ("first", 0, 0), ("second", 1, 1)
        ]  # fmt: skip
        await until(lambda: supervisor.ready("second"))
        ended.set()

    bench.run([bench.program("first"), bench.program("second")], kill)
    assert len(bench.pids("first")) == 1
    assert f"the process second ended with {number.name}" in bench.caplog.text
    assert bench.log()[-2:] == ["end second", "end first"]


def test_what_makes_no_progress_is_killed_and_started_again(bench, until):
    hang = bench.folder / "only.hang"

    async def stall(supervisor, ended):
        hang.touch()
        await until(lambda: len(bench.pids("only")) == 2)
        hang.unlink()
        await until(lambda: supervisor.ready("only"))
        ended.set()

    bench.run([bench.program("only", watchdog_s=1.0)], stall)
    assert "made no progress for 1 s" in bench.caplog.text
    assert not psutil.pid_exists(bench.pids("only")[0])


def test_what_dies_again_and_again_is_given_up_and_the_rest_goes_on(bench, until, monkeypatch):
    monkeypatch.setattr(supervisor, "RESTARTS_WITHIN_S", 600.0)  # so many starts take a busy machine more than a minute

    async def let_it_die(supervising, ended):
        for restart in range(RESTARTS + 1):
            await until(lambda count=restart + 1: len(bench.pids("second")) == count and supervising.ready("second"))
            os.kill(bench.pids("second")[-1], signal.SIGKILL)
        await until(lambda: "is not started again" in bench.caplog.text)
        monkeypatch.setenv(RESTARTS_VARIABLE, environment(bench.pids("first")[0])[RESTARTS_VARIABLE])
        assert {name: counts.given_up for name, counts in restarts.read().items()} == {"first": False, "second": True}
        assert psutil.pid_exists(bench.pids("first")[0])
        ended.set()

    with pytest.raises(SupervisionError, match="fail again and again: second"):
        bench.run([bench.program("first"), bench.program("second")], let_it_die)
    assert len(bench.pids("second")) == RESTARTS + 1
    assert bench.log()[-1] == "end first"


@pytest.mark.parametrize(
    ("how", "limit_s", "words"),
    [("dies", 20.0, "ended with exit code 3 before it was ready"), ("mute", 2.0, "was not ready after 2 s")],
)
def test_what_does_not_become_ready_ends_everything_with_its_name(bench, how, limit_s, words):
    with pytest.raises(SupervisionError, match=f"the process second {words}"):
        bench.run([bench.program("first"), bench.program("second", how, start_limit_s=limit_s)], end)
    assert not bench.ready
    # Not by what it writes: on a busy machine Python itself has not started after 2 s.
    assert not psutil.Process().children()


def test_what_does_not_hear_sigterm_is_killed(bench):
    bench.run([bench.program("only", "deaf", stop_limit_s=0.5)], end)
    assert bench.log() == ["start only"]
    assert not psutil.pid_exists(bench.pids("only")[0])


def test_an_orphan_ends_itself(bench, until):
    script = f"""
import asyncio
from station.supervision.supervisor import Program, Supervisor
asyncio.run(Supervisor([{bench.program("only")!r}]).run(lambda: None, asyncio.Event()))
"""
    with subprocess.Popen([sys.executable, "-c", script]) as supervisor:
        asyncio.run(until(lambda: (bench.folder / "log").exists() and bench.pids("only")))
        supervisor.kill()
    asyncio.run(until(lambda: "end only" in bench.log()))


def test_without_a_supervisor_nothing_is_told(monkeypatch):
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", "/nowhere/at/all")
    notify("READY=1")
