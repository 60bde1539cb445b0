"""The soak's verdicts: what an interval decides, and what the page reports of a station that grows or does not."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest

from benchmarks.soak.heap import in_use_bytes
from benchmarks.soak.slopes import Slope, Verdict, slope

ROOT = Path(__file__).resolve().parents[2]
WINDOWS = 270
"""Of ten seconds: what an hour leaves after its warm-up."""
AT_S = [10.0 * number for number in range(WINDOWS)]
OWN, IN_USE = 7, -2
"""Columns of the verdicts on memory that no other process shares, and on what of it is in use."""


def remembering(seed, memory, deviation):
    """Noise of which each value carries a share of the one before."""
    noise = np.random.default_rng(seed).normal(0, deviation, WINDOWS)
    for place in range(1, WINDOWS):
        noise[place] += memory * noise[place - 1]
    return noise


def test_a_level_that_does_not_move_has_no_slope_at_all():
    assert slope(AT_S, [41.0] * WINDOWS) == Slope(0.0, 0.0, 0.0)


def test_too_few_points_have_no_slope():
    assert slope(AT_S[:7], [1.0] * 7) is None


@pytest.mark.parametrize(("mb_per_hour", "expected"), [(0.0, Verdict.YES), (0.5, Verdict.YES), (3.0, Verdict.NO)])
def test_an_hour_decides_about_one_megabyte_an_hour(mb_per_hour, expected):
    values = 100 + mb_per_hour * np.array(AT_S) / 3600 + remembering(1, 0.5, 0.1)
    found = slope(AT_S, list(values))
    assert found is not None
    assert found.below(1.0) is expected


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_the_interval_holds_the_true_slope_as_often_as_it_promises_also_where_values_remember(memory):
    found = [slope(AT_S, list(2.0 * np.array(AT_S) / 3600 + remembering(seed, memory, 1.0))) for seed in range(50)]
    # 47.5 of 50 are expected: fewer than 44 come of such an interval by chance once in 80 times; the seeds are fixed.
    assert sum(each is not None and each.low <= 2.0 <= each.high for each in found) >= 44


@pytest.fixture
def soak(monkeypatch):
    """The modules, which import each other as the benchmarks' programs do."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from benchmarks.soak import document, samples  # noqa: PLC0415

    return document, samples


def made(
    samples_module,
    leak_mb_per_hour=0.0,
    pid_after=None,
    windows=360,
    images_from=30,
    machine=0.0,
    station=0.0,
    returns=False,
    reaches=0.0,
):
    """An hour's samples of a station whose service grows, or which gets slower with its machine or by itself.

    With `returns`, samples lie within the refilling of a heap, whose freed memory is returned, ever nearer to its end.
    With `reaches`, the heap of the service has to be larger by so much from the middle on.
    """

    def one(number):
        at_s = 10.0 * (number + 1)
        noise = 0.05 * (number * 7 % 5)
        low = 8 * (1 - number / windows) * (number * 7 % 12) / 12 if returns else 0.0
        in_use = {"service": 120 + noise + leak_mb_per_hour * at_s / 3600, "plc": 42.8}
        free = {"service": 40 - low + reaches * (number > windows / 2), "plc": 0.0}
        pid = 7 if pid_after is None or number < pid_after else 8
        processes = {
            name: samples_module.ProcessSample(pid, each + free[name], each, each + free[name] + 20, 30, 6)
            for name, each in in_use.items()
        }
        removed = max(0, number - images_from)
        slower, as_started = 1 + machine * at_s / 3600, 1 + (machine + station) * at_s / 7200
        ours = slower + station * at_s / 3600
        own_s, whole_s = 0.1 * number * as_started, 8.0 * number
        counts = samples_module.StationCounts(4.0 * number, own_s, whole_s, 9.0 * number, removed, 0)
        latency = samples_module.Latency((200 + number % 7) * ours, (600 + number % 9) * ours, 900)
        bare = samples_module.Latency((100 + number % 5) * slower, (300 + number % 4) * slower, 900)
        return samples_module.Sample(at_s, processes, latency, bare, 2.0 * slower, counts, 40.0, 9.0)

    return [one(number) for number in range(windows)]


def row(text, begins):
    found = [line for line in text.splitlines() if line.startswith(f"| {begins} |")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in found]


def test_the_page_tells_a_process_that_grows_from_one_that_does_not(soak):
    document, samples = soak
    text = document.page(made(samples, leak_mb_per_hour=4.0), document.Ending({"PASS": 1436}, 0), 60, "", 1.0)
    memory, pieces = row(text, "service")
    assert (memory[OWN], *memory[-2:]) == ("no", "no", "0")
    assert (pieces[3], pieces[6]) == ("yes", "yes")
    assert [row(text, "plc")[0][column] for column in (OWN, IN_USE)] == ["yes"] * 2
    assert "Not decided" not in text
    assert "It was to run" not in text
    assert "1436 fruit" in text


@pytest.mark.parametrize(("leak_mb_per_hour", "held"), [(0.0, "yes"), (4.0, "no")])
def test_memory_that_is_returned_each_minute_is_no_leak_and_hides_none(soak, leak_mb_per_hour, held):
    document, samples = soak
    every = made(samples, leak_mb_per_hour, returns=True)
    text = document.page(every, document.Ending({}, 0), 60, "", 1.0)
    assert [row(text, "service")[0][column] for column in (OWN, IN_USE)] == [held] * 2
    windows = document.of_process(document.settled(every), "service", lambda each: each.unique_mb)
    assert str(windows.below(document.MOST_MB_PER_HOUR)) == "no", "else this shows nothing"


def test_a_heap_that_had_to_be_larger_once_is_told_from_a_leak(soak):
    document, samples = soak
    text = document.page(made(samples, reaches=3.0), document.Ending({}, 0), 60, "", 1.0)
    assert [row(text, "service")[0][column] for column in (OWN, IN_USE)] == ["not decided", "yes"]


PROGRAM = """
import sys
held = [bytearray(each) for each in [300_000, 700] * int(sys.argv[1])]
freed = [bytearray(300_000) for _ in range(100)]
last = bytearray(700)
del freed
print("ready", flush=True)
input()
"""
"""Keeps pairs of a large and a small piece, and a heap in which as much as 100 large ones is free below the last."""


def started(pairs):
    program = [sys.executable, "-c", PROGRAM, str(pairs)]
    retains = {**os.environ, "MALLOC_MMAP_THRESHOLD_": "8388608", "MALLOC_TRIM_THRESHOLD_": "67108864"}
    return subprocess.Popen(program, env=retains, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def test_what_is_free_in_a_heap_is_not_in_use_and_what_is_kept_is():
    found = {}
    for pairs in (0, 100):
        with started(pairs) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            found[pairs] = (in_use_bytes(process.pid), psutil.Process(process.pid).memory_full_info().uss)
            process.communicate("\n")
    assert found[0][1] - found[0][0] > 29e6
    assert found[100][0] - found[0][0] == pytest.approx(100 * 300_700, rel=0.02)


def test_a_process_that_has_ended_has_no_memory():
    with started(0) as process:
        process.communicate("\n")
    with pytest.raises(psutil.NoSuchProcess):
        in_use_bytes(process.pid)


@pytest.mark.parametrize(("machine", "station", "flat"), [(0.0, 0.0, "yes"), (0.4, 0.0, "yes"), (0.0, 0.4, "no")])
def test_a_station_that_gets_slower_is_told_from_a_machine_that_does(soak, machine, station, flat):
    document, samples = soak
    text = document.page(made(samples, machine=machine, station=station), document.Ending({}, 0), 60, "", 1.0)
    names = ("PLC's reply, p50, µs", "PLC's reply, p99, µs", "cycle's own time, ms")
    assert [row(text, name)[0][-1] for name in names] == [flat] * 3
    assert row(text, "trigger to outcome, s")[0][-1] == "yes"
    assert all("+0.0" in row(text, name)[0][3] for name in names) == (not machine and not station)


@pytest.mark.parametrize("windows", [1, 9, 150])
def test_a_short_run_decides_nothing_and_says_so(soak, windows):
    document, samples = soak
    ending = document.Ending({}, None)
    text = document.page(made(samples, windows=windows), ending, 60, "", 1.0)
    assert "**Not decided**" in text
    assert "It was to run for 60 minutes" in " ".join(text.splitlines())
    assert [row(text, "service")[0][column] for column in (OWN, IN_USE)] == ["not decided"] * 2


def test_a_process_that_was_started_again_is_named_and_its_slope_is_that_of_the_new_one(soak):
    document, samples = soak
    grows_then_restarts = made(samples, leak_mb_per_hour=0.0, pid_after=200)
    text = document.page(grows_then_restarts, document.Ending({}, 0), 60, "", 1.0)
    assert row(text, "service")[0][-1] == "1"


def test_an_error_that_ended_the_run_is_on_the_page(soak):
    document, samples = soak
    text = document.page(made(samples), document.Ending({}, None), 60, "the panels ended", 1.0)
    assert "It ended early: the panels ended" in text


def test_the_plot_is_drawn_from_one_sample_on(soak, tmp_path):
    document, samples = soak
    for number in (1, 40):
        document.draw(made(samples)[:number], tmp_path / "images" / "soak.svg")
        assert "<svg" in (tmp_path / "images" / "soak.svg").read_text()


def test_counts_of_the_metrics_are_summed_over_their_labels(soak):
    _, samples = soak
    text = """# TYPE station_inspections_total counter
station_inspections_total{fruit="strawberry",outcome="PASS",reason=""} 3
station_inspections_total{fruit="raspberry",outcome="FAIL",reason="early_stop"} 2
# TYPE station_records_images_total counter
station_records_images_total{result="kept"} 20
station_records_images_total{result="removed"} 12
station_records_images_total{result="dropped"} 1
# TYPE station_outbox_waiting gauge
station_outbox_waiting{destination="mqtt"} 4
station_outbox_waiting{destination="postgresql"} 5
"""
    found = samples.counts(text)
    assert (found.fruit, found.images_kept, found.images_removed, found.waiting) == (5, 20, 12, 9)
