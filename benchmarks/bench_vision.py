"""Milliseconds for each stage of the measurement methods on one thread, beside other libraries' same steps.

Run with `./run bench vision [--before REVISION]`. Writes `docs/speed.md`.
"""

import argparse
import functools
import json
import os
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
from revision import checked_out
from skimage.restoration import denoise_nl_means
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from station.settings.segmentation import PaperParameters, RobustParameters
from station.twin.digit.press import render_press
from station.vision.median import median_image
from station.vision.paper import PaperMethod, amplified_difference, brightest_cluster, clean, denoise
from station.vision.robust import RobustMethod

ROOT = Path(__file__).resolve().parents[1]
RUNS = 15
PEER_RUNS = 3
ROUNDS = 3
CLOSINGS_MM = (1.0, 3.0, 5.0)
FRUITS = ("strawberry", "raspberry", "blueberry", "rubber_ball")


def median_ms(step: Callable[[], object], runs: int) -> float:
    """The median time of a step after one warm-up, in milliseconds."""
    step()
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        step()
        times.append(1000 * (time.perf_counter() - began))
    return statistics.median(times)


def scikit_kmeans(denoised: np.ndarray, parameters: PaperParameters) -> object:
    """scikit-learn's K-means with the same number of clusters, starts and iterations."""
    pixels = denoised.reshape(-1, 3).astype(np.float32)
    return KMeans(
        parameters.clusters,
        n_init=parameters.kmeans_starts,
        max_iter=10,
        tol=1e-3,
        random_state=parameters.seed,
    ).fit(pixels)


def scikit_nlm(difference: np.ndarray, parameters: PaperParameters) -> object:
    """scikit-image's fast non-local means with the same patch and search sizes."""
    return denoise_nl_means(
        difference,
        patch_size=parameters.template_window_px,
        patch_distance=parameters.search_window_px // 2,
        h=parameters.denoise_h,
        fast_mode=True,
        channel_axis=2,
        preserve_range=True,
    )


def paper_rows(image: np.ndarray, reference: np.ndarray) -> list[tuple[str, float, str, float | None]]:
    """Each stage of the paper's method: its name, ms, and the same step elsewhere with its ms."""
    parameters = PaperParameters()
    difference = amplified_difference(image, reference, parameters.amplification)
    denoised = denoise(difference, parameters)
    clustered = brightest_cluster(denoised, parameters)
    return [
        (
            "difference, amplified",
            median_ms(lambda: amplified_difference(image, reference, parameters.amplification), RUNS),
            "",
            None,
        ),
        (
            "denoised, non-local means",
            median_ms(lambda: denoise(difference, parameters), RUNS),
            f"scikit-image {version('scikit-image')}",
            median_ms(lambda: scikit_nlm(difference, parameters), PEER_RUNS),
        ),
        (
            "clustered, K-means",
            median_ms(lambda: brightest_cluster(denoised, parameters), RUNS),
            f"scikit-learn {version('scikit-learn')}",
            median_ms(lambda: scikit_kmeans(denoised, parameters), PEER_RUNS),
        ),
        ("morphology and components", median_ms(lambda: clean(clustered, parameters), RUNS), "", None),
    ]


def robust_ms(file: Path) -> list[float]:
    """The robust method's milliseconds for each frame in a file of references and frames, in rounds."""
    presses = pickle.loads(file.read_bytes())
    steps = [
        functools.partial(RobustMethod(median_image(references), RobustParameters()).measure, frame)
        for references, frames in presses
        for frame in frames
    ]
    return [
        min(times) for times in zip(*([median_ms(step, RUNS) for step in steps] for _ in range(ROUNDS)), strict=True)
    ]


def paired_rows(revision: str) -> list[tuple[str, float, str, float | None]]:
    """The robust method of an earlier revision and of this one, each in a process of its own, on the same frames."""
    presses = [render_press(kind, 1, CLOSINGS_MM) for kind in FRUITS]
    with checked_out(revision) as tree, tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.pickle"
        file.write_bytes(pickle.dumps([(press.references, press.frames) for press in presses]))
        times = [
            json.loads(
                subprocess.run(
                    [sys.executable, __file__, "--frames", str(file)],
                    env={**os.environ, "PYTHONPATH": str(path)},
                    capture_output=True,
                    check=True,
                ).stdout
            )
            for path in (tree, ROOT)
        ]
    before, now = (statistics.median(each) for each in times)
    quicker = statistics.median(one / other for one, other in zip(*times, strict=True))
    return [
        (f"`robust` of revision {revision}, median of the same frames", before, "", None),
        (f"`robust` beside it, {quicker:.2f} times as quick", now, "", None),
    ]


def whole_rows() -> list[tuple[str, float, str, float | None]]:
    """Both methods as a whole, in turn on the same frames: each frame's best of some rounds, and the frames' median."""
    robust: dict[str, list[float]] = {}
    paper: list[float] = []
    for kind in FRUITS:
        press = render_press(kind, 1, [0.0, *CLOSINGS_MM])
        ours = RobustMethod(median_image(press.references), RobustParameters())
        theirs = PaperMethod(press.references[0], PaperParameters())
        for closing_mm, frame in zip((0.0, *CLOSINGS_MM), press.frames, strict=True):
            one, other = functools.partial(ours.measure, frame), functools.partial(theirs.measure, frame)
            times = [(median_ms(one, RUNS), median_ms(other, 1)) for _ in range(ROUNDS)]
            name = kind.replace("_", " ") if closing_mm else "nothing touching"
            robust.setdefault(name, []).append(min(ms for ms, _ in times))
            if closing_mm:
                paper.append(min(ms for _, ms in times))
    touching = [ms for name, each in robust.items() if name != "nothing touching" for ms in each]
    middle, theirs_ms = statistics.median(touching), statistics.median(paper)
    return [
        (f"`paper`, whole, median of {len(paper)} frames", theirs_ms, "", None),
        (f"`robust`, whole, median of the same frames (1/{theirs_ms / middle:.0f} of paper's time)", middle, "", None),
        *((f"`robust`, {name}", statistics.median(each), "", None) for name, each in robust.items()),
    ]


def main() -> None:
    """Measure on one thread, print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", metavar="REVISION", help="time the robust method of this revision beside today's")
    parser.add_argument("--frames", type=Path, help=argparse.SUPPRESS)  # how `--before` runs each of the two
    wanted = parser.parse_args()
    cv2.setNumThreads(1)
    if wanted.frames:
        with threadpool_limits(1):
            print(json.dumps(robust_ms(wanted.frames)))
        return
    press = render_press("raspberry", 1, [CLOSINGS_MM[1]])
    image, reference = press.frames[0], press.references[0]
    with threadpool_limits(1):
        rows = paper_rows(image, reference) + whole_rows()
    if wanted.before:
        rows += paired_rows(wanted.before)
    lines = [
        "# Speed of the measurement",
        "",
        f"Written by `./run bench vision`: medians of {RUNS} runs ({PEER_RUNS} of the other libraries), one thread,",
        f"640x480: the stages of a simulated raspberry at {CLOSINGS_MM[1]:g} mm of closing, the whole methods of four",
        f"fruits at {', '.join(f'{mm:g}' for mm in CLOSINGS_MM)} mm, in turn, the quietest of {ROUNDS} rounds each.",
        f"OpenCV {cv2.__version__}, numpy {np.__version__}.",
        "",
        "| stage | ms | the same step elsewhere | its ms |",
        "|---|---|---|---|",
        *(
            f"| {name} | {ms:.1f} | {peer} | {'' if peer_ms is None else f'{peer_ms:.1f}'} |"
            for name, ms, peer, peer_ms in rows
        ),
        "",
    ]
    print("\n".join(lines))
    (ROOT / "docs" / "speed.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
