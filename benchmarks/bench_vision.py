"""Milliseconds for each stage of the measurement methods on one thread, beside other libraries' same steps.

Run with `./run bench vision`. Writes `docs/speed.md`.
"""

import functools
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
from skimage.restoration import denoise_nl_means
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from station.settings.segmentation import PaperParameters, RobustParameters
from station.twin.digit.press import render_press
from station.vision.paper import PaperMethod, amplified_difference, brightest_cluster, clean, denoise
from station.vision.robust import RobustMethod

ROOT = Path(__file__).resolve().parents[1]
RUNS = 15
PEER_RUNS = 3
CLOSING_MM = 3.0
OTHER_FRUITS = ("strawberry", "blueberry", "rubber_ball")


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
        n_init=parameters.kmeans_starts,  # pyright: ignore[reportArgumentType] (scikit-learn says str, and takes numbers)
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


def whole_rows(image: np.ndarray, reference: np.ndarray) -> list[tuple[str, float, str, float | None]]:
    """Both methods as a whole, measured in turn; the quieter of two rounds counts."""
    robust, paper = RobustMethod([reference], RobustParameters()), PaperMethod(reference, PaperParameters())
    times = [(median_ms(lambda: robust.measure(image), RUNS), median_ms(lambda: paper.measure(image), 3)) for _ in "12"]
    ours, theirs = min(time[0] for time in times), min(time[1] for time in times)
    return [
        ("`paper`, whole", theirs, "", None),
        (f"`robust`, whole, 1/{theirs / ours:.0f} of it", ours, "", None),
    ]


def other_rows() -> list[tuple[str, float, str, float | None]]:
    """The robust method on other simulated frames."""
    rows: list[tuple[str, float, str, float | None]] = []
    for kind in OTHER_FRUITS:
        press = render_press(kind, 1, [0.0, CLOSING_MM])
        method = RobustMethod(press.references, RobustParameters())
        names = ("nothing touching", kind.replace("_", " "))
        for name, frame in list(zip(names, press.frames, strict=True))[0 if not rows else 1 :]:
            rows.append((f"`robust`, {name}", median_ms(functools.partial(method.measure, frame), RUNS), "", None))
    return rows


def main() -> None:
    """Measure on one thread, print and write the table."""
    cv2.setNumThreads(1)
    press = render_press("raspberry", 1, [CLOSING_MM])
    image, reference = press.frames[0], press.references[0]
    with threadpool_limits(1):
        rows = paper_rows(image, reference) + whole_rows(image, reference) + other_rows()
    lines = [
        "# How long a measurement takes",
        "",
        f"Written by `./run bench vision`: medians of {RUNS} runs ({PEER_RUNS} of the other libraries), one thread, a",
        f"640x480 image of a simulated raspberry, or what a row names, at {CLOSING_MM:g} mm of closing;",
        f"OpenCV {cv2.__version__}, numpy {np.__version__}.",
        "",
        "| stage | ms | the same step elsewhere | ms |",
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
