"""Likeness of the twin's DIGIT to a real one, and its cost: writes the tables and pictures of docs/twin.md.

usage: bench_twin.py [--real FOLDER] [--side-by-side FOLDER]

FOLDER of --real holds digit_presses and digit_backgrounds (default: ../shared/data beside the checkout). With
--side-by-side real and drawn presses are written next to each other into a folder of yours, for a visual check.
"""

import argparse
import asyncio
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import psutil

mpl.use("Agg")
from matplotlib import pyplot as plt
from twin.fit import (
    PRESS_GAP_S,
    SMOOTHING_MM,
    Press,
    ball_dent,
    fit_table,
    free_of_contact,
    read_presses,
)
from twin.statistics import measure_noise

from station.devices.camera.health import FrameHealth
from station.devices.camera.twin import TwinCamera
from station.memory import keep_freed_memory
from station.settings.camera import CameraSettings, TwinCameraSettings
from station.settings.segmentation import PaperParameters
from station.twin.clock import SteadyClock
from station.twin.digit.codec import Image
from station.twin.digit.optics import Optics
from station.twin.digit.press import PressOptions, render_press
from station.twin.digit.sensor import DigitSensor
from station.twin.digit.server import DigitCameraServer, digit_faults
from station.twin.digit.spoil import FRAME_FAULTS, spoiled
from station.twin.fruit import Kind, draw_fruit
from station.twin.gel import SENSOR_SHAPE, Gel
from station.twin.world import DIGIT_MM, World
from station.vision.paper import PaperMethod

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
BOX_MARGINS_PX = {"contact's edge": 0, "+ 40 px": 40}
NOISE_FRAMES = 400
HEALTH_UNITS = 12
CLOSINGS_MM = {
    Kind.STRAWBERRY: (1.0, 2.0, 4.0, 8.0),
    Kind.RASPBERRY: (1.0, 2.0, 4.0, 8.0),
    Kind.BLUEBERRY: (1.0, 2.0, 4.0, 8.0),
    Kind.RUBBER_BALL: (1.0, 2.0, 4.0, 7.0),
    Kind.TEST_SPHERE: (0.3, 0.6, 1.0, 1.4),
}


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table; numbers keep two figures behind the point where they are small."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(shown(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def shown(cell: object) -> str:
    """A cell's text."""
    if isinstance(cell, float | np.floating):
        return f"{cell:.2f}" if abs(cell) < 100 else f"{cell:,.0f}"
    return f"{cell:,}" if isinstance(cell, int | np.integer) else str(cell)


def around(press: Press, margin_px: float) -> tuple[slice, slice]:
    """The box about a contact, cut at the image's border."""
    reach = press.radius_px + margin_px
    top, left = max(0, int(press.y_px - reach)), max(0, int(press.x_px - reach))
    return slice(top, int(press.y_px + reach) + 1), slice(left, int(press.x_px + reach) + 1)


def realism(reference: Image, presses: list[Press]) -> str:
    """Mean absolute error of drawn presses on the half that the table was not fitted on."""
    halves = {"even": presses[::2], "odd": presses[1::2]}
    rows: list[list[object]] = []
    for fitted_on, tested_on in (("even", "odd"), ("odd", "even")):
        optics = Optics(fit_table(reference, halves[fitted_on]), SMOOTHING_MM)
        sensor = DigitSensor(0)
        silent = DigitSensor(0, noise=0.0, drift=0.0).frame(None, 0.0).astype(np.float32)
        for name, margin_px in BOX_MARGINS_PX.items():
            errors = []
            for index, press in enumerate(halves[tested_on]):
                box = around(press, margin_px)
                drawn = np.clip(reference + optics.change(ball_dent(press, Gel())), 0, 255)
                noise = sensor.frame(None, index * PRESS_GAP_S) - silent
                errors.append(
                    [
                        np.abs(press.image - drawn)[box].mean(),
                        np.abs(press.image - np.clip(drawn + noise, 0, 255))[box].mean(),
                        np.abs(press.image.astype(float) - reference)[box].mean(),
                    ]
                )
            rows.append([f"{fitted_on} → {tested_on}", name, *np.mean(errors, axis=0)])
    return table(["fitted → tested", "box", "twin", "twin with its noise and drift", "no contact"], rows)


def noise(presses: list[Press]) -> str:
    """The noise of real frames and of the twin's, by one ruler."""
    real = measure_noise([press.image for press in presses], [free_of_contact(press) for press in presses])
    sensor, free = DigitSensor(1), np.ones(SENSOR_SHAPE, np.bool_)
    frames = [sensor.frame(None, PRESS_GAP_S * index) for index in range(NOISE_FRAMES)]
    twin = measure_noise(frames, [free] * len(frames))
    rows = []
    for name in real.__dataclass_fields__:
        was, now = getattr(real, name), getattr(twin, name)
        ratio = float(now.mean() / was.mean())
        rows.append(
            [name.replace("_", " "), *(" / ".join(f"{one:.2f}" for one in level) for level in (was, now)), ratio]
        )
    return table(["change from frame to frame", "real B / G / R", "twin B / G / R", "ratio of means"], rows)


def paper(reference: Image, presses: list[Press]) -> str:
    """The published pipeline on the real presses and on the same presses drawn by the twin."""
    parameters = PaperParameters()
    rows_y, rows_x = np.indices(SENSOR_SHAPE)
    scores: dict[str, list[list[float]]] = {"real": [], "twin": []}
    nothing = []
    for index, press in enumerate(presses):
        sensor = DigitSensor(100 + index)
        untouched = sensor.frame(None, 0.0)
        touched = sensor.frame(ball_dent(press, Gel()), PRESS_GAP_S)
        truth = np.hypot(rows_x - press.x_px, rows_y - press.y_px) <= press.radius_px
        for name, before, after in (("real", reference, press.image), ("twin", untouched, touched)):
            mask = PaperMethod(before, parameters).measure(after).mask > 0
            scores[name].append([(mask & truth).sum() / (mask | truth).sum(), mask.sum() / truth.sum()])
        nothing.append(PaperMethod(untouched, parameters).measure(sensor.frame(None, 2 * PRESS_GAP_S)).area_px)
    rows: list[list[object]] = []
    for name, found in scores.items():
        iou, ratio = np.array(found).T
        rows.append([name, np.median(iou), np.percentile(iou, 10), np.median(ratio)])
    low, middle, high = np.percentile(nothing, [10, 50, 90])
    return (
        table(["presses", "IoU median", "IoU 10th percentile", "area ÷ truth, median"], rows)
        + f"\n\nWith nothing touching the twin's gel the pipeline reports {middle:,.0f} px "
        f"(10th to 90th percentile {low:,.0f} to {high:,.0f}); on real frames 5,000 to 90,000 px are known."
    )


def edges() -> str:
    """Return a table of how far the visible edge (steepest fall-off of the change) is from the true mask's edge, px."""
    rows: list[list[object]] = []
    for kind in (Kind.TEST_SPHERE, Kind.RUBBER_BALL):
        for closing_mm in CLOSINGS_MM[kind]:
            press = render_press(kind, 0, [-1.0, closing_mm], PressOptions(noise=0.0, drift=0.0))
            change = np.linalg.norm(press.frames[1].astype(np.float32) - press.frames[0], axis=2)
            polar = cv2.warpPolar(change, (239, 720), (239.5, 319.5), 239, cv2.WARP_POLAR_LINEAR)
            profile = cv2.GaussianBlur(polar.mean(axis=0)[None], (0, 0), 3)[0]
            true_px = float(np.sqrt((press.true_masks[1] > 0).sum() / np.pi))
            low, high = int(0.7 * true_px), min(238, int(1.4 * true_px))
            visible_px = float(np.argmin(np.diff(profile)[low:high])) + low + 0.5
            rows.append([str(kind), closing_mm, true_px, visible_px - true_px])
    return table(["body", "closing, mm", "true radius, px", "visible edge beyond it, px"], rows)


def health() -> str:
    """False alarms over good frames of many units and fruit, and how many spoilt frames are found and named."""
    good = false = 0
    found: dict[str, list[int]] = {fault: [0, 0, 0] for fault in FRAME_FAULTS}
    for unit in range(HEALTH_UNITS):
        for kind, closings in CLOSINGS_MM.items():
            press = render_press(kind, unit, [*closings] * 12, PressOptions(unit=unit or None))
            judge, before = FrameHealth(0.2, SENSOR_SHAPE), None
            for frame in (*press.references, *press.frames):
                good, false = good + 1, false + bool(judge.judge(frame, before, 0.0))
                before = frame
            for number, frame in enumerate(press.frames[:: len(closings)]):
                for fault, counts in found.items():
                    faults = digit_faults()
                    faults.set(fault)
                    named = judge.judge(spoiled(frame, faults, number), None, 0.0)
                    counts[0] += 1
                    counts[1] += bool(named)
                    counts[2] += named == {fault.removeprefix("frame_")}
    rows: list[list[object]] = [["good", good, false, "-"]]
    rows += [[fault.removeprefix("frame_"), *counts] for fault, counts in found.items()]
    return table(["frames", "number", "reported as faulty", "correctly named"], rows)


def milliseconds(call: Callable[[], object], times: int) -> float:
    """Median time of a call on this thread."""
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return 1000 * float(np.median(taken))


def costs() -> str:
    """Time for a frame, and the share of a core that the twin's camera and its driver take at 30 frames/s."""
    world = World(SteadyClock())
    world.place(draw_fruit("strawberry", 0))
    sensor = DigitSensor(0)
    opening_mm = iter(np.linspace(70, 60, 100_000))
    times = iter(range(100_000))

    def still() -> None:
        sensor.frame(None, next(times) / 30)

    def moving() -> None:
        world.force_N(next(opening_mm))
        footprint = world.footprint()
        sensor.frame(footprint.dent if footprint else None, next(times) / 30)

    white = np.random.default_rng(0)

    def peer() -> None:
        white.standard_normal((*SENSOR_SHAPE, 3), np.float32)

    judge, frame = FrameHealth(0.2, SENSOR_SHAPE), sensor.frame(None, 0.0)
    rows = [
        ["frame, nothing moves (clean image kept)", milliseconds(still, 150)],
        ["frame while the fingers close (dent and optics computed again)", milliseconds(moving, 150)],
        ["judging a frame's health, in the driver", milliseconds(lambda: judge.judge(frame, None, 0.0), 50)],
        ["for comparison: one image of white noise from numpy", milliseconds(peer, 30)],
    ]
    shares = {name: asyncio.run(core_share(close)) for name, close in (("still", False), ("closing", True))}
    return (
        table(["on one thread", "ms, median"], rows)
        + f"\n\nServer and driver together at 30 frames/s over TCP take {shares['still']:.0%} of a core while nothing "
        f"moves and {shares['closing']:.0%} while the fingers close all the time."
    )


async def core_share(close: bool, seconds: float = 6.0) -> float:  # noqa: FBT001 (named by its only caller)
    """Share of a core that this process takes while it serves and reads frames."""
    clock = SteadyClock()
    world = World(clock)
    world.place(draw_fruit("strawberry", 0))
    server = DigitCameraServer(world, DigitSensor(0), clock, digit_faults())
    await server.start()
    camera = TwinCamera(CameraSettings(twin=TwinCameraSettings(port=server.port)))
    await camera.open()
    before, began_s = psutil.Process().cpu_times(), time.monotonic()
    while (passed_s := time.monotonic() - began_s) < seconds:
        if close:
            world.force_N(DIGIT_MM + 35.0 - 5.0 * passed_s / seconds)
        await asyncio.sleep(1 / 60)
    after = psutil.Process().cpu_times()
    await camera.close()
    await server.stop()
    return (after.user + after.system - before.user - before.system) / seconds


def picture_presses(path: Path) -> None:
    """Drawn presses of each kind, and below each the change times three with the true edge."""
    rows = []
    for kind, closings in CLOSINGS_MM.items():
        press = render_press(kind, 3, closings)
        reference = np.median(press.references, axis=0)
        shown_frames = [
            *press.frames,
            *(outlined(f - reference, m) for f, m in zip(press.frames, press.true_masks, strict=True)),
        ]
        rows.append(np.hstack(shown_frames))
    sheet = np.vstack(rows)
    cv2.imwrite(str(path), cv2.resize(sheet, None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA))


def outlined(change: npt.NDArray[np.floating], mask: npt.NDArray[np.uint8]) -> Image:
    """A change times three about mid-grey, with a mask's outline in white."""
    picture = np.clip(128 + 3 * change, 0, 255).astype(np.uint8)
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, (255, 255, 255), 3)
    return picture


def picture_units(path: Path) -> None:
    """Backgrounds of the fitted unit and of generated ones."""
    frames = [DigitSensor(0, unit).frame(None, 0.0) for unit in (None, *range(9))]
    cv2.imwrite(str(path), cv2.resize(np.hstack(frames), None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA))


def picture_errors(path: Path, reference: Image, presses: list[Press]) -> None:
    """Mean change over the distance from the contact's centre, and where drawn and real presses differ."""
    optics = Optics(fit_table(reference, presses[::2]), SMOOTHING_MM)
    half = 110
    profiles, errors = [], []
    for press in presses[1::2]:
        drawn = np.clip(reference + optics.change(ball_dent(press, Gel())), 0, 255)
        real, twin = press.image.astype(np.float32) - reference, drawn - reference
        real -= np.median(real[free_of_contact(press)], axis=0)
        centre = (press.x_px, press.y_px)
        sizes = [np.linalg.norm(cv2.GaussianBlur(change, (0, 0), 3), axis=2) for change in (real, twin)]
        inside = to_polar(np.ones(SENSOR_SHAPE, np.float32), centre) > 0.99
        profiles.append([np.where(inside, to_polar(size, centre), np.nan) for size in sizes])
        around_it = (2 * half, 2 * half)
        patches = [cv2.getRectSubPix(np.abs(one).mean(axis=2), around_it, centre) for one in (real, real - twin)]
        errors.append(patches)
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    curves = np.nanmean(np.array(profiles), axis=(0, 2))
    for curve, name in zip(curves, ("real", "twin"), strict=True):
        axes[0].plot(curve, label=name)
    axes[0].set(xlabel="distance from the contact's centre, px", ylabel="size of the change, grey levels")
    axes[0].legend()
    for axis, patch, name in zip(axes[1:], np.mean(errors, axis=0), ("no contact drawn", "twin"), strict=True):
        axis.imshow(patch, vmin=0, vmax=30, cmap="magma")
        axis.set(title=f"mean absolute error: {name}", xticks=[], yticks=[])
    figure.colorbar(axes[1].images[0], ax=axes[1:], label="grey levels")
    figure.savefig(path, dpi=80)
    plt.close(figure)


def to_polar(image: npt.NDArray[np.float32], centre: tuple[float, float]) -> npt.NDArray[np.float32]:
    """An image over angle (rows) and distance from a centre (columns, px); 0 beyond the image's border."""
    flags = cv2.WARP_POLAR_LINEAR | cv2.WARP_FILL_OUTLIERS
    return np.asarray(cv2.warpPolar(image, (150, 360), centre, 150, flags), np.float32)


def side_by_side(folder: Path, reference: Image, presses: list[Press]) -> None:
    """Real and drawn presses next to each other, for a visual check only."""
    folder.mkdir(parents=True, exist_ok=True)
    for index, press in enumerate(presses):
        sensor = DigitSensor(index)
        untouched, drawn = sensor.frame(None, 0.0), sensor.frame(ball_dent(press, Gel()), 10.0)
        mask = np.where(free_of_contact(press), 0, 255).astype(np.uint8)
        changes = [outlined(a.astype(np.float64) - b, mask) for a, b in ((press.image, reference), (drawn, untouched))]
        cv2.imwrite(str(folder / f"{Path(press.name).stem}.png"), np.hstack([press.image, drawn, *changes]))


def write_tables(path: Path, tables: Iterator[tuple[str, str]]) -> None:
    """Put each table between its two marks in a document."""
    text = path.read_text(encoding="utf-8")
    for name, content in tables:
        print(f"\n{name}\n{content}", flush=True)
        marks = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        text = marks.sub(lambda found, content=content: f"{found[1]}{content}\n{found[2]}", text)
    path.write_text(text, encoding="utf-8")


def main() -> None:
    """Measure everything and write it down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--side-by-side", type=Path)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    keep_freed_memory()  # as `station twin` does
    reference, presses = read_presses(arguments.real / "digit_presses")
    if arguments.side_by_side:
        side_by_side(arguments.side_by_side, reference, presses)
    picture_presses(DOCS / "twin-presses.png")
    picture_units(DOCS / "twin-units.png")
    picture_errors(DOCS / "twin-errors.png", reference, presses)
    makers: list[tuple[str, Callable[[], str]]] = [
        ("realism", lambda: realism(reference, presses)),
        ("noise", lambda: noise(presses)),
        ("edges", edges),
        ("costs", costs),
        ("health", health),
        ("paper", lambda: paper(reference, presses)),
    ]
    write_tables(DOCS / "twin.md", ((name, make()) for name, make in makers))


if __name__ == "__main__":
    main()
