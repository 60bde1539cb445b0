"""The station measures by its sensor's calibration, reports so, and demands a verification where that is configured."""

import asyncio
import contextlib
import os
import subprocess
import time
import urllib.request
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from station.calibration import store as calibration_store
from station.calibration.model import Check, GelChange, Verification, stamp
from station.calibration.report import calibration_files
from station.calibration.store import CalibrationStore
from station.channel.client import ChannelClient
from station.channel.line import (
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    CommandName,
    Line,
    Outcome,
    StationState,
)
from station.channel.panel_run import GetPanelState, PanelState
from station.messages import calibration as messages
from station.messages import grip, readiness
from station.messages.message import verbatim
from station.records.database import reading, records_folder
from station.records.queries import read_inspection
from station.runtime.devices.calibration import ActiveCalibration
from station.runtime.imaging.golden_reference import GoldenReference
from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import panel_endpoint
from station.settings.plc import line_endpoint
from station.settings.segmentation import Segmentation
from station.state_files import StateFiles

LINE = Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=())
FAILED = Check(
    name="wear", passed=False, found=verbatim("41%"), expected=verbatim("75%"), remedy=verbatim("change the gel")
)


def verification(calibration, made_at, *checks):
    return Verification(
        id=stamp(made_at),
        serial=calibration.serial,
        calibration=calibration.id,
        operator="anna",
        passed=all(check.passed for check in checks),
        area_ratio=0.97,
        onset_mm=41.8,
        checks=checks,
        curve=(),
    )


def in_use(home, after, serial="T0001", **settings):
    """Return the active calibration as the station has it at a time after it was made."""
    service = {"uncalibrated": settings.pop("uncalibrated", "refuse")}
    configuration = Configuration.model_validate({"home": home, "calibration": settings, "service": service})
    return ActiveCalibration(configuration, lambda: serial, after.timestamp)


def test_the_scale_gate_and_golden_reference_are_the_sensors_own(stored, draft, tmp_path):
    calibration = draft.calibration.model_copy(
        update={
            "id": stamp(draft.calibration.made_at + timedelta(hours=1)),
            "noise": draft.calibration.noise.model_copy(update={"gate_factor": 1.3}),
        }
    )
    calibrated = in_use(tmp_path, draft.calibration.made_at)
    assert calibrated.in_force.mm_per_px == draft.calibration.mm_per_px
    assert draft.calibration.id in str(calibrated.in_force.words)
    stored.add_calibration(calibration, calibration_files(draft))
    assert calibrated.calibration == calibration
    assert calibrated.gate_factor == 1.3
    golden = GoldenReference(StateFiles(tmp_path), calibrated.golden)
    golden.store_first(np.zeros((640, 480, 3), np.uint8))
    assert not (tmp_path / "golden_reference.png").exists()
    prepared = golden.prepared(Segmentation())
    assert prepared is not None
    assert prepared.renewal == grip.RENEW_BY_CALIBRATION()
    another = in_use(tmp_path, calibration.made_at, "D11111")
    assert another.in_force[:2] == (0.0266, messages.NONE(scale_mm=0.0266))
    assert (another.gate_factor, another.golden()) == (1.0, None)


def test_a_scale_that_was_not_measured_leaves_the_sites_in_force(store, draft, tmp_path):
    usual = draft.calibration.model_copy(update={"scale_measured": False, "mm_per_px": 0.0266})
    store.add_calibration(usual, {})
    configuration = Configuration.model_validate({"home": tmp_path, "camera": {"mm_per_px": 0.028}})
    assert ActiveCalibration(configuration, lambda: "T0001").in_force.mm_per_px == 0.028


def test_age_and_a_failed_verification_are_told(stored, draft, tmp_path):
    made_at = draft.calibration.made_at
    young = in_use(tmp_path, made_at + timedelta(days=80))
    assert (young.alarm_detail(), young.figures.age_s) == (None, 80 * 86_400.0)
    assert young.figures[1:] == (None, None)
    old = in_use(tmp_path, made_at + timedelta(days=91)).alarm_detail()
    assert old == messages.OLD(age_days=91.0, limit_days=90.0)
    stored.add_verification(verification(draft.calibration, made_at + timedelta(hours=1), FAILED), {})
    failed = young.alarm_detail()
    assert failed is not None
    assert messages.CHECK_WEAR.id in failed.ids()
    assert young.figures.verification_age_s == pytest.approx(80 * 86_400 - 3600)
    assert young.figures.drift == pytest.approx(-0.03)


def test_nothing_is_ready_without_the_verification_that_is_demanded(stored, draft, tmp_path):
    made_at = draft.calibration.made_at
    assert in_use(tmp_path, made_at).refusal() is None
    another = in_use(tmp_path, made_at, "D11111", verify_every_h=8.0, uncalibrated="allow")
    assert "not calibrated" in str(another.refusal())
    assert another.alarm_detail() == messages.MISSING()
    demanded = in_use(tmp_path, made_at + timedelta(hours=9), verify_every_h=8.0)
    assert "never verified" in str(demanded.refusal())
    assert demanded.alarm_detail() == demanded.refusal()
    stored.add_verification(verification(draft.calibration, made_at + timedelta(hours=0.5)), {})
    assert "8.5 h old, at most 8 h" in str(demanded.refusal())
    assert demanded.alarm_detail() == demanded.refusal()
    stored.add_verification(verification(draft.calibration, made_at + timedelta(hours=8)), {})
    assert (demanded.refusal(), demanded.alarm_detail()) == (None, None)
    stored.add_verification(verification(draft.calibration, made_at + timedelta(hours=8.5), FAILED), {})
    assert "by `station verify`" in str(demanded.refusal())
    failed = demanded.alarm_detail()
    assert failed is not None
    assert messages.CHECK_WEAR.id in failed.ids()


def test_a_sensor_without_a_calibration_is_refused_and_an_alarm_unless_it_is_allowed(stored, draft, tmp_path):
    made_at = draft.calibration.made_at
    calibrated, another = in_use(tmp_path, made_at), in_use(tmp_path, made_at, "D11111")
    assert (calibrated.refusal(), calibrated.alarm_detail()) == (None, None)
    assert "not calibrated: calibrate it with the ball on the page Maintenance" in str(another.refusal())
    assert another.alarm_detail() == messages.MISSING()
    unknown = in_use(tmp_path, made_at, "")
    assert (unknown.refusal() is not None, unknown.alarm_detail()) == (True, None), (
        "no sensor was met yet, or it is none"
    )
    allowed = in_use(tmp_path, made_at, "D11111", uncalibrated="allow")
    assert (allowed.refusal(), allowed.alarm_detail()) == (None, None)
    assert "allowed by service.uncalibrated" in str(allowed.in_force.words)


GEL_CHANGE = GelChange(operator="ben", changed_at=datetime(2026, 11, 29, 10, 15, tzinfo=UTC))


def test_after_a_changed_gel_the_sensor_is_refused_with_who_and_when_until_it_is_calibrated(stored, draft, tmp_path):
    made_at = draft.calibration.made_at
    required, allowed = in_use(tmp_path, made_at), in_use(tmp_path, made_at, uncalibrated="allow")
    assert required.refusal() is None
    stored.mark_gel_changed("T0001", GEL_CHANGE)
    assert (required.calibration, required.golden(), required.gate_factor) == (None, None, 1.0)
    assert "gel was changed (2026-11-29 10:15 UTC, ben): calibrate it" in str(required.refusal())
    assert required.alarm_detail() == required.refusal()
    assert (allowed.refusal(), allowed.alarm_detail()) == (None, None)
    assert allowed.in_force.words == messages.NONE_ALLOWED(scale_mm=0.0266)
    new = draft.calibration.model_copy(update={"id": stamp(made_at + timedelta(hours=1))})
    stored.add_calibration(new, {})
    assert (required.calibration, required.refusal(), required.alarm_detail()) == (new, None, None)


def test_a_changed_gel_is_seen_where_the_kernels_clock_did_not_move_meanwhile(stored, draft, tmp_path, monkeypatch):
    folder = tmp_path / "calibrations" / "T0001"
    tick_ns = folder.stat().st_mtime_ns
    write, calibrated = calibration_store.write_atomically, in_use(tmp_path, draft.calibration.made_at)

    def within_a_tick(path, data):
        write(path, data)
        os.utime(folder, ns=(tick_ns, tick_ns))

    monkeypatch.setattr(calibration_store, "write_atomically", within_a_tick)
    assert calibrated.calibration == draft.calibration
    stored.mark_gel_changed("T0001", GEL_CHANGE)
    assert calibrated.calibration is None


@pytest.mark.timeout(600)
def test_a_fruit_is_measured_by_the_calibration_and_its_record_names_it(site, draft, unused_ports):
    [metrics_port] = unused_ports(1)
    with site.configuration.open("a") as file:
        file.write(f"calibration: {{verify_every_h: 8}}\nmetrics: {{port: {metrics_port}}}\n")
    site.twin(do="remove")
    store = CalibrationStore(site.home)
    calibration = draft.calibration.model_copy(update={"serial": site.serial, "id": stamp(datetime.now(UTC))})
    store.add_calibration(calibration, {})
    process = subprocess.Popen(
        site.command("service", "--log", "json"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    try:
        outcome = asyncio.run(inspected(site, store, calibration))
        metrics = urllib.request.urlopen(f"http://127.0.0.1:{metrics_port}/metrics", timeout=20).read().decode()
    finally:
        process.terminate()
        process.communicate(timeout=60)
    assert outcome.area_mm2 == pytest.approx(outcome.area_px * calibration.mm_per_px**2)
    assert "station_calibration_age_seconds" in metrics
    assert "station_calibration_drift_ratio -0.03" in metrics
    folder = records_folder(site.home)
    with reading(folder) as connection:
        judged = read_inspection(connection, outcome.sequence, folder).judged
    assert judged is not None
    assert calibration.id in judged.devices["calibration"]
    assert judged.measures["mm_per_px"] == calibration.mm_per_px


async def inspected(site, store, calibration):
    """One fruit's outcome, with the verification made only once it is requested."""
    configuration = load_configuration(site.configuration)
    verified = reset = False
    async with ChannelClient(line_endpoint(configuration.handshake, configuration.home), "the station") as client:
        deadline_s = time.monotonic() + 300
        while not (state := await beat(client)).ready:
            assert time.monotonic() < deadline_s, state.why_not_ready
            why = state.why_not_ready
            if why is not None and why.id == readiness.NO_RECIPE.id:
                command = Command(command=CommandName.CHANGE_RECIPE, argument=1)
                await client.request(command, CommandDone, deadline_s=40)
            elif why is not None and why.id == messages.NEVER_VERIFIED.id:
                verified = True
                assert "never verified" in str((await glance(configuration)).check_due)
                store.add_verification(verification(calibration, datetime.now(UTC)), {})
            elif state.boot and not reset:
                reset = (
                    await client.request(Command(command=CommandName.RESET, argument=0), CommandDone, deadline_s=40)
                ).done
            await asyncio.sleep(0.1)
        assert verified
        site.twin(do="fruit", kind="strawberry", seed=2)
        reply = await client.request(Begin(trigger_id=1, encoder=0, lot="A"), BeginReply, deadline_s=40)
        assert reply.sequence is not None, reply
        return await client.request(AwaitOutcome(sequence=reply.sequence), Outcome, deadline_s=100)


async def glance(configuration):
    """Return the state that the pages receive."""
    async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as client:
        return await client.request(GetPanelState(), PanelState, deadline_s=20)


async def beat(client):
    with contextlib.suppress(Exception):
        return await client.request(LINE, StationState, deadline_s=10)
    return StationState.model_construct(boot="", ready=False, why_not_ready=None)  # pyrefly: ignore[missing-argument] (only what is read)
