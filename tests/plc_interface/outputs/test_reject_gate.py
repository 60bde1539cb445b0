"""Outcomes become shots of the gate, over losses of the gate, the bus and the interface."""

import asyncio
from typing import Any

import pytest

from plc_interface.outputs.line_output import NoOutput, RejectGate, make_output
from plc_interface.outputs.pending_rejects_file import PendingRejectFile
from station.channel.line import Outcome
from station.messages import can as messages
from station.settings.can import CanSettings
from station.twin.faults import CommonFault

LEASE_S = 40.0


def outcome(sequence, name, encoder, **changes):
    """Return an outcome with the fields that the gate reads; PASS is a sure one."""
    measured: dict[str, Any] = {"area_mm2": 12.3, "late": False, "simulated": False}
    return Outcome.model_construct(sequence=sequence, outcome=name, encoder=encoder, **(measured | changes))


@pytest.fixture
def gated(on_bus, tmp_path):
    """Run a scenario with a gate; `rig.gate` may be stopped and made anew, as by a restart of the interface."""

    def play(scenario, **settings):
        async def whole(rig):
            rig.faults.set(CommonFault.STUCK)

            async def start():
                rig.gate = RejectGate(rig.settings, tmp_path)
                await rig.gate.start()
                rig.gate.renew_health(LEASE_S)
                await rig.until(lambda: rig.gate.ready)
                await rig.until(lambda: rig.gate.encoder_count() == rig.nodes.encoder.count)

            rig.restart, rig.folder = start, tmp_path
            await start()
            try:
                await scenario(rig)
            finally:
                await rig.gate.stop()

        on_bus(whole, start=False, **({"distance_counts": 1500} | settings))

    return play


def fired(rig):
    return [(shot.sequence, shot.lane) for shot in rig.nodes.gate.fired]


def armed(rig, *sequences):
    return rig.until(lambda: set(rig.nodes.gate._armed) == set(sequences))


def move_to(rig, count):
    """Move the belt, which stands."""
    rig.nodes.encoder._way = float(count)


def test_what_is_not_pass_is_shot_into_the_rejects_and_pass_is_not(gated):
    async def scenario(rig):
        count = rig.gate.encoder_count()
        for sequence, name in ((1, "PASS"), (2, "FAIL"), (3, "PASS"), (4, "NO_RESULT")):
            rig.gate.publish(outcome(sequence, name, count - sequence))
        await armed(rig, 2, 4)
        assert {shot.at_count for shot in rig.nodes.gate._armed.values()} == {count + 1498, count + 1496}
        rig.run_belt()
        await rig.until(lambda: rig.gate.counters.get("can_shots_fired") == 2)
        assert sorted(fired(rig)) == [(2, 1), (4, 1)]
        assert rig.gate.faults == ()

    gated(scenario)


@pytest.mark.parametrize(
    "unsure", [{"simulated": True}, {"late": True}, {"area_mm2": None}], ids=["simulated", "late", "no area"]
)
def test_a_pass_that_is_not_sure_is_shot_by_a_real_gate(tmp_path, unsure):
    async def scenario():
        gate = RejectGate(CanSettings(enabled=True, interface="socketcan", channel="can0"), tmp_path)
        gate.publish(outcome(1, "PASS", 0))
        gate.publish(outcome(2, "PASS", 0, **unsure))
        assert set(gate._due) == {2}
        await gate.stop()

    asyncio.run(scenario())


@pytest.mark.parametrize(
    "bus",
    [
        {"interface": "udp_multicast"},
        {"interface": "virtual", "channel": "line"},
        {"interface": "socketcan", "channel": "vcan0"},
    ],
    ids=lambda bus: bus["interface"],
)
def test_the_twins_gate_lets_a_simulated_pass_go_on(tmp_path, bus):
    async def scenario():
        gate = RejectGate(CanSettings(enabled=True, **bus), tmp_path)
        gate.publish(outcome(1, "PASS", 0, simulated=True))
        gate.publish(outcome(2, "PASS", 0, simulated=True, area_mm2=None))
        gate.publish(outcome(3, "FAIL", 0, simulated=True))
        assert set(gate._due) == {2, 3}
        await gate.stop()

    asyncio.run(scenario())


def test_no_shot_waits_for_the_disk_where_the_plc_waits_for_the_interface(gated, monkeypatch):
    async def scenario(rig):
        monkeypatch.setattr("os.fsync", lambda _: pytest.fail("the loop of the PLC's replies waits for the disk"))
        rig.gate.publish(outcome(1, "FAIL", rig.gate.encoder_count()))
        assert set(PendingRejectFile(rig.folder).read()) == {1}, "a kill loses no shot"
        await armed(rig, 1)
        rig.run_belt()
        await rig.until(lambda: not rig.gate._due)

    gated(scenario)


def test_an_outcome_that_comes_again_is_one_shot(gated):
    async def scenario(rig):
        count = rig.gate.encoder_count()
        for _ in range(2):
            rig.gate.publish(outcome(5, "FAIL", count))
        await armed(rig, 5)
        rig.run_belt()
        await rig.until(lambda: rig.gate.counters.get("can_shots_fired") == 1)
        assert fired(rig) == [(5, 1)]
        assert rig.gate.faults == ()

    gated(scenario)


def test_a_shot_of_an_outcome_given_while_the_gate_is_away_is_fired_once_it_is_back(gated):
    """As after a loss of the station: no heartbeat, the gate is safe, and NO_RESULT remains."""

    async def scenario(rig):
        count = rig.gate.encoder_count()
        rig.gate.publish(outcome(6, "FAIL", count))
        await armed(rig, 6)
        rig.gate.renew_health(0.0)
        await rig.until(lambda: not rig.gate.ready and not rig.nodes.gate.operational)
        assert rig.nodes.gate.output == rig.settings.safe_output
        rig.gate.publish(outcome(7, "NO_RESULT", count))
        rig.gate.renew_health(LEASE_S)
        await armed(rig, 6, 7)
        rig.run_belt()
        await rig.until(lambda: len(fired(rig)) == 2)
        assert sorted(fired(rig)) == [(6, 1), (7, 1)]

    gated(scenario)


def test_a_shot_outlives_the_interface(gated):
    async def scenario(rig):
        rig.gate.publish(outcome(8, "FAIL", rig.gate.encoder_count()))
        await armed(rig, 8)
        await rig.gate.stop()
        await rig.until(lambda: not rig.nodes.gate.operational)
        await rig.restart()
        rig.gate.publish(outcome(8, "FAIL", rig.gate.encoder_count()))
        await armed(rig, 8)
        rig.run_belt()
        await rig.until(lambda: rig.gate.counters.get("can_shots_fired") == 1)
        assert fired(rig) == [(8, 1)]
        rig.faults.set(CommonFault.STUCK)
        await rig.gate.stop()
        await rig.restart()
        assert rig.gate._due == {}

    gated(scenario)


def test_a_run_of_rejects_longer_than_the_gates_places_is_diverted_as_places_become_free(gated):
    """30 s of fruit before the flap are more than the places; the next fruit has to get the free one."""

    async def scenario(rig):
        last = 30
        at_gate = {sequence: rig.gate.encoder_count() + 300 * sequence for sequence in range(1, last + 1)}
        for sequence in (*range(1, 9), *range(last, 8, -1)):  # the place is not the first waiting one's
            rig.gate.publish(outcome(sequence, "FAIL", at_gate[sequence] - rig.settings.distance_counts))
        for sequence, count in at_gate.items():
            await armed(rig, *range(sequence, min(sequence + 8, last + 1)))
            move_to(rig, count)
            await rig.until(lambda sequence=sequence: fired(rig)[-1:] == [(sequence, 1)])
        await rig.until(lambda: not rig.gate._due)
        assert rig.gate.faults == ()
        assert rig.gate.counters["can_shots_ordered"] == rig.gate.counters["can_shots_fired"] == last

    # A machine that stalls for a second must not lose a node, whose orders would come again.
    gated(scenario, distance_counts=10_000, heartbeat_lost_s=10.0, count_stale_s=5.0, echo_deadline_s=5.0)


def test_an_order_that_a_full_gate_refuses_is_repeated_until_a_place_is_free(gated, monkeypatch):
    monkeypatch.setattr("station.twin.can.gate._PLACES", 2)

    async def scenario(rig):
        count = rig.gate.encoder_count()
        for sequence in (1, 2, 3):
            rig.gate.publish(outcome(sequence, "FAIL", count + 300 * sequence - 1500))
        await rig.until(lambda: rig.gate.counters.get("can_shots_ordered", 0) > 3)
        assert set(rig.nodes.gate._armed) == {1, 2}
        move_to(rig, count + 300)
        await armed(rig, 2, 3)
        rig.run_belt()
        await rig.until(lambda: not rig.gate._due)
        assert rig.gate.faults == ()
        assert fired(rig) == [(1, 1), (2, 1), (3, 1)]

    gated(scenario)


def test_a_fruit_that_passes_a_full_gate_is_a_fault(gated, monkeypatch):
    monkeypatch.setattr("station.twin.can.gate._PLACES", 0)

    async def scenario(rig):
        rig.gate.publish(outcome(1, "FAIL", rig.gate.encoder_count()))
        await rig.until(lambda: rig.gate.counters.get("can_shots_ordered", 0) > 1)
        assert rig.gate.faults == ()
        rig.run_belt()
        await rig.until(lambda: not rig.gate._due)
        (fault,) = rig.gate.faults
        assert messages.COUNT_PAST.id in fault.what.ids()
        assert fired(rig) == []

    gated(scenario)


def test_an_encoder_that_counts_back_a_little_on_a_stopped_belt_costs_no_reject(gated):
    async def scenario(rig):
        rig.gate.publish(outcome(1, "FAIL", rig.gate.encoder_count() + 100))
        await armed(rig, 1)
        rig.run_belt()
        await rig.until(lambda: not rig.gate._due)
        assert rig.gate.faults == ()
        assert fired(rig) == [(1, 1)]

    gated(scenario, tolerance_counts=1000)


@pytest.mark.parametrize(("off", "why"), [(-1501, messages.COUNT_PAST), (101, messages.COUNT_TOO_FAR)])
def test_a_count_that_cannot_be_the_fruits_fires_nothing_and_is_a_fault(gated, off, why):
    async def scenario(rig):
        rig.gate.publish(outcome(9, "FAIL", rig.gate.encoder_count() + off))
        await rig.until(lambda: rig.gate.faults)
        (fault,) = rig.gate.faults
        assert fault.part == "reject"
        assert fault.what.parameters["sequence"] == 9
        assert why.id in fault.what.ids()
        await rig.until(lambda: not rig.gate._due)
        assert fired(rig) == []
        assert rig.gate.counters["can_shots_failed"] == 1

    gated(scenario, tolerance_counts=100)


def test_shots_on_the_disk_that_cannot_be_read_stop_nothing(tmp_path):
    (tmp_path / "shots.json").write_text('{"1": null}')
    settings = CanSettings(enabled=True)
    assert make_output(settings, tmp_path)._due == {}  # pyrefly: ignore[missing-attribute] (of the real output)
    assert isinstance(make_output(CanSettings(enabled=False), tmp_path), NoOutput)
