"""A calibration at the panel: what the page reports of it and what is in force agree, also with a slow disk."""

import asyncio
import errno
import threading
import time

import pytest

from station.calibration.store import Prepared
from station.records.audit_report import read_audit
from station.records.database import reading
from station.runtime.rpc.calibration import PanelCalibration
from tests.runtime.ball import PRESSED_S, end_run, run_now, start_run

DEADLINE_S = 2.0
"""The records' default."""


def stored(cell):
    """The calibration in force, and whether the audit trail has one."""
    with reading(cell.configuration.home / "records") as connection:
        audited = [row.action for row in read_audit(connection, 100)].count("calibration.stored")
    return cell.station.service._devices.calibration.calibration, audited


@pytest.mark.timeout(400)
def test_a_calibration_that_the_disk_delays_is_not_called_failed_nor_called_off(at_ball, monkeypatch):
    started, called_off = threading.Event(), threading.Event()
    put_in_force, close = Prepared.put_in_force, PanelCalibration.close

    def slow(self):
        started.set()
        assert called_off.wait(60)
        time.sleep(1.5 * DEADLINE_S)
        return put_in_force(self)

    async def closing(self):
        called_off.set()
        await close(self)

    monkeypatch.setattr(Prepared, "put_in_force", slow)
    monkeypatch.setattr(PanelCalibration, "close", closing)

    async def scenario():
        async with at_ball() as (cell, panel, _):
            await start_run(panel, ())
            await cell.until(started.is_set, PRESSED_S)
            ended = await end_run(panel)
            assert ended.state == "passed", ended
            calibration, audited = stored(cell)
            assert calibration is not None
            assert audited == 1

    asyncio.run(scenario())


@pytest.mark.timeout(400)
def test_a_calibration_whose_transaction_fails_is_not_in_force(at_ball, monkeypatch):
    put_in_force = Prepared.put_in_force

    def then_full(self):
        put_in_force(self)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Prepared, "put_in_force", then_full)

    async def scenario():
        async with at_ball() as (cell, panel, _):
            await start_run(panel, ())

            async def over():
                return (await run_now(panel)).state != "running"

            await cell.until(over, PRESSED_S)
            run = await run_now(panel)
            assert run.state == "failed"
            assert "No space left on device" in str(run.result)
            assert stored(cell) == (None, 0)

    asyncio.run(scenario())
