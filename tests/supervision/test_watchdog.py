"""The supervisor below systemd: ready, in progress, stopping, reported over a real notification socket."""

import os
import signal
import socket

import pytest

from station.supervision import supervisor as supervising


@pytest.fixture
def systemd(tmp_path, monkeypatch):
    """Yield a function that returns what systemd's end of the socket has received, line by line."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "systemd"))
        listening.settimeout(0.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "systemd"))
        heard: list[str] = []

        def hear() -> list[str]:
            while True:
                try:
                    heard.extend(listening.recv(4096).decode().splitlines())
                except BlockingIOError:
                    return heard

        yield hear


def test_progress_of_all_feeds_the_watchdog_and_the_end_is_told(bench, until, systemd):
    async def play(_supervisor, ended):
        await until(lambda: systemd().count("WATCHDOG=1") >= 3)
        assert "STOPPING=1" not in systemd()
        ended.set()

    bench.run([bench.program("first"), bench.program("second")], play)
    assert systemd()[0] == "STATUS=running: first, second"
    assert systemd()[-1] == "STOPPING=1"


def test_while_one_of_them_hangs_nothing_is_fed(bench, until, systemd, monkeypatch):
    hang = bench.folder / "second.hang"
    silent = supervising._Child.trouble

    async def play(supervisor, ended):
        await until(lambda: "WATCHDOG=1" in systemd())
        # It is not started again, so that how long it hangs is not a matter of time.
        monkeypatch.setattr(supervising._Child, "trouble", lambda _child: "")
        hang.touch()
        first, second = supervisor._children
        await until(lambda: first.heard_s - second.heard_s > 3.0)
        systemd().clear()
        heard_s = first.heard_s
        await until(lambda: first.heard_s - heard_s > 2.0)
        assert "WATCHDOG=1" not in systemd()
        # What hung is started again, and with its progress the watchdog is fed again.
        monkeypatch.setattr(supervising._Child, "trouble", silent)
        hang.unlink()
        await until(lambda: "WATCHDOG=1" in systemd())
        ended.set()

    bench.run([bench.program("first"), bench.program("second", watchdog_s=2.0)], play)


def test_what_is_given_up_is_told_and_the_rest_is_not_ended_for_it(bench, until, systemd, monkeypatch):
    monkeypatch.setattr(supervising, "RESTARTS", 1)

    async def play(supervisor, ended):
        for count in (1, 2):
            await until(lambda count=count: len(bench.pids("second")) == count and supervisor.ready("second"))
            os.kill(bench.pids("second")[-1], signal.SIGKILL)
        await until(
            lambda: any(
                line.startswith("STATUS=the process second ended with SIGKILL, after 1 restarts") for line in systemd()
            )
        )
        assert "STATUS=running; second ended with SIGKILL: restart 1 since the start" in systemd()
        systemd().clear()
        await until(lambda: "WATCHDOG=1" in systemd())
        ended.set()

    with pytest.raises(supervising.SupervisionError, match="fail again and again: second"):
        bench.run([bench.program("first"), bench.program("second")], play)
