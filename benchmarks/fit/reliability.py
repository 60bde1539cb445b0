"""Reliability: share of judged areas that are wrong, by the least confidence."""

import csv
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from bench_measurement import circle
from matplotlib.figure import Figure
from measurement import on_the_twin
from measurement.data_sets import PressData, in_processes, read, soft_presses
from measurement.soft_bodies import KINDS

from fit.evaluation import LARGE_ERROR, LEAST_MM2, Trial, is_judged, measure
from fit.parts import Group
from fit.progress import report
from station.settings.segmentation import RobustParameters
from station.twin.digit.codec import as_jpeg
from station.vision.contact import Image
from station.vision.median import median_image
from station.vision.press import PressTracker
from station.vision.robust import RobustMethod

mpl.use("Agg")
PICTURE = Path(__file__).resolve().parents[2] / "docs" / "robust-reliability.png"
LEAST_CONFIDENCES = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
MOST_WRONG = {"real": 0.01, "twin": 0.03}
"""Share of the judged areas."""
FIRST_SEEDS = {"fruit": 97_000, "bruised": 98_000, "soft": 99_000}
"""Of each kind. Nothing was chosen on these and the next, but the least confidence itself."""
TWIN_SEEDS = 4
"""Of each fruit in each condition, and of each soft body: some thousand areas, for an interval to choose by."""
_SEEDS_APART = 10
"""More than there are conditions, each of which takes the next seed."""
SHIFT_PX = 5
NOISE_LEVELS = 6.0

Bools = npt.NDArray[np.bool_]


class Perturbation(NamedTuple):
    """One change of real images."""

    name: str
    change: Callable[[Image, np.random.Generator], Image]
    on_reference: bool = True
    """Whether the reference is changed alike; else the frame alone."""
    moves: bool = False
    """Whether the truth moves with the image."""


def _levels(table: npt.NDArray[np.float64]) -> Callable[[Image, np.random.Generator], Image]:
    levels = np.clip(np.rint(table), 0, 255).astype(np.uint8)
    return lambda image, _: np.asarray(cv2.LUT(image, levels), np.uint8)


def _with_noise(image: Image, generator: np.random.Generator) -> Image:
    noise = generator.normal(0, NOISE_LEVELS, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def _shifted(image: Image, _: np.random.Generator) -> Image:
    moved = np.array([[1, 0, SHIFT_PX], [0, 1, SHIFT_PX]], np.float32)
    size = (image.shape[1], image.shape[0])
    return np.asarray(cv2.warpAffine(image, moved, size, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _scaled(image: Image, _: np.random.Generator, *, scale: float) -> Image:
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)


_ALL = np.arange(256, dtype=np.float64)
PERTURBATIONS = (
    Perturbation("brightness x0.8", _levels(0.8 * _ALL), on_reference=False),
    Perturbation("brightness x1.2", _levels(1.2 * _ALL), on_reference=False),
    Perturbation("gamma 0.8", _levels(255 * (_ALL / 255) ** 0.8)),
    Perturbation("gamma 1.25", _levels(255 * (_ALL / 255) ** 1.25)),
    Perturbation("blur, 1.5 px", lambda image, _: np.asarray(cv2.GaussianBlur(image, (0, 0), 1.5), np.uint8)),
    Perturbation("noise, 6 levels", _with_noise),
    Perturbation("JPEG 30", lambda image, _: as_jpeg(image, 30)),
    Perturbation("JPEG 60", lambda image, _: as_jpeg(image, 60)),
    Perturbation(
        "turned by 180°", lambda image, _: np.asarray(cv2.rotate(image, cv2.ROTATE_180), np.uint8), moves=True
    ),
    Perturbation("mirrored", lambda image, _: np.asarray(cv2.flip(image, 1), np.uint8), moves=True),
    Perturbation("shifted by 5 px", _shifted, moves=True),
    Perturbation("scaled to 0.75", partial(_scaled, scale=0.75), moves=True),
    Perturbation("scaled to 0.5", partial(_scaled, scale=0.5), moves=True),
)
"""Of the image and its reference alike: camera, storage and geometry. Brightness is of the frame alone: light ages."""


def perturbed(folder: Path) -> dict[str, Group]:
    """The real presses under each perturbation, at the images' own size."""
    reference = read(folder / "reference.jpg")
    rows = list(csv.DictReader((folder / "contacts.csv").read_text().splitlines()))
    images = [read(folder / row["image"]) for row in rows]
    truths = [circle(row, ("centre_x_px", "centre_y_px", "radius_px")) for row in rows]
    found: dict[str, Group] = {}
    for number, one in enumerate(PERTURBATIONS):
        generator = np.random.default_rng(number)
        own = one.change(reference, generator) if one.on_reference else reference
        presses: list[PressData] = []
        for image, truth in zip(images, truths, strict=True):
            seen = one.change(image, generator)
            presses.append(PressData(one.name, [own], [seen], [_moved(truth, one, generator)]))
        found[one.name] = Group(presses)
    return found


def _moved(truth: Bools, one: Perturbation, generator: np.random.Generator) -> Bools:
    if not one.moves:
        return truth
    drawn = np.repeat(np.where(truth, 255, 0).astype(np.uint8)[..., None], 3, axis=2)
    return np.asarray(one.change(drawn, generator)[..., 0] > 127)


class Count(NamedTuple):
    """Judged areas of one kind of data at one least confidence."""

    contacts: int
    judged: int
    wrong: int
    presses: int
    """With a judged area."""

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the wrong share, as of so many presses: the areas of one err together."""
        z, n = 1.96, max(self.presses, 1)
        share = self.wrong / max(self.judged, 1)
        middle = (share + z * z / (2 * n)) / (1 + z * z / n)
        half = z * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n)) / (1 + z * z / n)
        return max(0.0, float(middle - half)), min(1.0, float(middle + half))


class Area(NamedTuple):
    """One measured contact of more than 2 mm²."""

    group: str
    """A row of the table: a perturbation, a fruit or a soft body."""
    press: tuple[str | int, ...]
    """Which press shows it; a real one is the same under every perturbation."""
    error: float
    """Relative, against the truth."""
    judged: bool


def twin_areas(job: tuple[str, int, bool]) -> list[list[Area]]:
    """One fruit in all conditions, measured as by the station: three frames a step, doubted where they disagree.

    Args:
        job: the kind, the first seed and whether it is bruised.

    Returns:
        The areas for each of `LEAST_CONFIDENCES`.
    """
    kind, seed, bruised = job
    cv2.setNumThreads(1)
    found: list[list[Area]] = [[] for _ in LEAST_CONFIDENCES]
    name = f"bruised {kind}" if bruised else kind
    for _, condition, press in on_the_twin.twin_presses(seed, [kind], bruised=bruised):
        for own, least in zip(found, LEAST_CONFIDENCES, strict=True):
            method = RobustMethod(median_image(press.references), RobustParameters(least_confidence=least))
            tracker = PressTracker(method)
            contacts = [tracker.measure_step(step.frames) for step in press.steps]
            own += [
                Area(name, (name, seed, condition), abs(c.area_px / s.true_px - 1), is_judged(c, least))
                for c, s in zip(contacts, press.steps, strict=True)
                if s.true_mm2 > LEAST_MM2
            ]
    return found


def twin_jobs() -> list[tuple[str, int, bool]]:
    """Every kind of fruit, sound and bruised."""
    sets = ((on_the_twin.FRUITS, "fruit"), (on_the_twin.BRUISED_FRUITS, "bruised"))
    return [
        (kind, FIRST_SEEDS[name] + _SEEDS_APART * number, name == "bruised")
        for kinds, name in sets
        for kind in kinds
        for number in range(TWIN_SEEDS)
    ]


_shared: dict[str, Mapping[str, Group]] = {}


def _measured(least_confidence: float) -> dict[str, list[Area]]:
    cv2.setNumThreads(1)
    trial = Trial(parameters=RobustParameters(least_confidence=least_confidence))
    found: dict[str, list[Area]] = {}
    for name, groups in _shared.items():
        found[name] = [
            Area(group, (number,) if name == "real" else (group, number), step.error, step.judged)
            for group, presses in measure(groups, trial).items()
            for number, press in enumerate(presses)
            for step in press.steps
            if step.true_mm2 > LEAST_MM2
        ]
    return found


def counted(areas: Sequence[Area]) -> Count:
    """Count some areas: all, those judged, those judged and wrong, and the presses with a judged one."""
    judged = [one for one in areas if one.judged]
    wrong = sum(one.error > LARGE_ERROR for one in judged)
    return Count(len(areas), len(judged), wrong, len({one.press for one in judged}))


def reliability(images: Path, processes: int) -> list[str]:
    """The reliability's section, and its picture.

    Args:
        images: the folder of real images.
        processes: how many.
    """
    first = FIRST_SEEDS["soft"]
    softs = in_processes([partial(soft_presses, range(seed, seed + 1)) for seed in range(first, first + TWIN_SEEDS)])
    _shared["real"] = perturbed(images / "digit_presses")
    _shared["soft"] = {
        kind.replace("_", " "): Group([press for press in softs if press.group == kind], followed=True)
        for kind in KINDS
    }
    areas: list[dict[str, list[Area]]] = []
    with ProcessPoolExecutor(processes) as pool:
        for least, found in zip(LEAST_CONFIDENCES, pool.map(_measured, LEAST_CONFIDENCES), strict=True):
            areas.append({"real": found["real"], "twin": [], "soft": found["soft"]})
            report(f"reliability: least confidence {least:g}")
        jobs = twin_jobs()
        for number, by_least in enumerate(pool.map(twin_areas, jobs), start=1):
            for own, more in zip(areas, by_least, strict=True):
                own["twin"] += more
            report(f"reliability: {number} of {len(jobs)} sets of the twin's fruit")
    counts = {name: [counted(own[name]) for own in areas] for name in areas[0]}
    _draw(counts)
    return _lines(counts, areas)


def smallest(counts: Mapping[str, Sequence[Count]]) -> float | None:
    """The smallest least confidence from which on neither real presses nor the twin's fruit are wrong too often.

    Soft bodies do not count for this: what is wrong there are long rods of half the field, and no fruit is one.
    """
    chosen = None
    for place in reversed(range(len(LEAST_CONFIDENCES))):
        if any(counts[name][place].wrong > most * counts[name][place].judged for name, most in MOST_WRONG.items()):
            break
        chosen = LEAST_CONFIDENCES[place]
    return chosen


def _lines(counts: Mapping[str, Sequence[Count]], areas: Sequence[Mapping[str, Sequence[Area]]]) -> list[str]:
    titles = {
        "real": f"real, {len(PERTURBATIONS)} perturbations",
        "twin": "twin's fruit, seven conditions",
        "soft": "soft bodies, followed",
    }
    lines = [
        f"Share of the judged areas above 2 mm² that are wrong by more than {LARGE_ERROR:.0%}, with Wilson's 95 %",
        "interval, which counts a press once, since its areas err together; by the least confidence of the recipe; and",
        "the share of contacts that is judged. Real: all 30 presses of the ball under each perturbation. Brightness",
        "changes in the frame alone, as light ages; all else in frame and reference alike, since it is the camera, the",
        "storage or the geometry. The twin's fruit, sound and bruised, are measured as by the station: three frames a",
        "step, doubted as far as they disagree. Of soft bodies each image is the mean of three frames, whose agreement",
        "is not used. Only the least confidence was chosen on these seeds of the twin.",
        "",
        "| least confidence | " + " | ".join(f"{title}: wrong | judged" for title in titles.values()) + " |",
        "|---" * 7 + "|",
    ]
    for place, least in enumerate(LEAST_CONFIDENCES):
        cells: list[str] = []
        for name in titles:
            one = counts[name][place]
            low, high = one.interval
            share = one.wrong / max(one.judged, 1)
            cells += [
                f"{one.wrong} of {one.judged}: {share:.1%} ({low:.1%} to {high:.1%})",
                f"{one.judged / max(one.contacts, 1):.0%}",
            ]
        lines.append(f"| {least:g} | " + " | ".join(cells) + " |")
    chosen = smallest(counts)
    limits = f"{MOST_WRONG['real']:.0%} on real presses and {MOST_WRONG['twin']:.0%} on the twin's fruit"
    answer = f"is {chosen:g}" if chosen is not None else f"is above {LEAST_CONFIDENCES[-1]:g}"
    lines += [
        "",
        f"The smallest least confidence for at most {limits} {answer}.",
        "Soft bodies do not count for this: what is wrong there are long rods of half the field, and no fruit is one.",
        "",
        f"![curve]({PICTURE.name})",
        "",
    ]
    place = LEAST_CONFIDENCES.index(RobustParameters().least_confidence)
    lines += [
        f"At the recipe's default of {LEAST_CONFIDENCES[place]:g}, one by one:",
        "",
        "| data | contacts | judged | wrong | median error |",
        "|---|---|---|---|---|",
    ]
    for own in areas[place].values():
        for name in dict.fromkeys(one.group for one in own):
            group = [one for one in own if one.group == name]
            one, error = counted(group), np.median([area.error for area in group])
            lines.append(f"| {name} | {one.contacts} | {one.judged} | {one.wrong} | {error:.3f} |")
    return lines


def _draw(counts: Mapping[str, Sequence[Count]]) -> None:
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    wrong, judged = figure.subplots(1, 2)
    for (name, own), colour in zip(counts.items(), ("tab:blue", "tab:green", "tab:orange"), strict=True):
        bounds = np.array([one.interval for one in own])
        wrong.plot(LEAST_CONFIDENCES, [100 * c.wrong / max(c.judged, 1) for c in own], color=colour, label=name)
        wrong.fill_between(LEAST_CONFIDENCES, 100 * bounds[:, 0], 100 * bounds[:, 1], color=colour, alpha=0.15)
        judged.plot(LEAST_CONFIDENCES, [100 * c.judged / max(c.contacts, 1) for c in own], color=colour, label=name)
    for limit in sorted(set(MOST_WRONG.values())):
        wrong.axhline(100 * limit, color="grey", linewidth=0.8, linestyle=":")
    wrong.set(xlabel="least confidence", ylabel="wrong by more than 25 %, % of judged", ylim=(0, None))
    judged.set(xlabel="least confidence", ylabel="judged, % of contacts", ylim=(0, 102))
    wrong.legend(frameon=False)
    figure.savefig(PICTURE, dpi=110)
