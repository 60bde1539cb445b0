"""The robust method on contacts that the image's border cuts, by where their middle lies."""

import numpy as np

from measurement.on_the_twin import FRUITS, LARGE_ERROR, squeezed
from measurement.peers import PEER, contact_area_idea
from station.settings.segmentation import RobustParameters
from station.twin.contact import Pose
from station.twin.digit.press import PressOptions
from station.vision.median import median_image
from station.vision.robust import RobustMethod
from station.vision.step import mean_image, measure_step
from station.vocabulary import Flag

CLOSINGS_MM = (0.8, 1.2, 2.5, 5.0, 7.0)
BORDER_SEED = 96_000
"""Nothing was chosen on it."""
PLACES = {
    "1 mm beyond the border": ((-38.0, 320.0), (240.0, 678.0)),
    "on the border": ((0.0, 320.0), (480.0, 320.0), (240.0, 0.0)),
    "1 mm within": ((38.0, 320.0), (442.0, 320.0), (240.0, 38.0)),
    "2 mm within": ((75.0, 320.0), (405.0, 320.0), (240.0, 565.0)),
    "a corner, 1 mm within": ((38.0, 38.0), (442.0, 602.0)),
}
"""x and y of the fruit's middle, px."""


def border_table() -> list[str]:
    """Area over the visible part's, and what of the wrong ones nothing tells of."""
    header = (
        "| fruit's middle | cut contacts over 2 mm² | area over the visible part's: p10, median, p90 "
        f"| smaller by more than {LARGE_ERROR:.0%} | of them neither flagged as a lower bound nor doubted "
        f"| {PEER}: area over it, median | smaller |"
    )
    lines = [header, "|---|---|---|---|---|---|---|"]
    parameters = RobustParameters()
    for place, middles in PLACES.items():
        ratios: list[float] = []
        peers: list[float] = []
        untold = 0
        for number, (x_px, y_px) in enumerate(middles):
            for kind in FRUITS:
                options = PressOptions(pose=Pose(x_px, y_px), unit=number or None)
                press = squeezed(kind, BORDER_SEED + number, CLOSINGS_MM, options)
                method = RobustMethod(median_image(press.references), parameters)
                peer = contact_area_idea(median_image(press.references))
                for step in press.steps:
                    if step.true_mm2 > 2 and step.is_cut:
                        contact = measure_step(method, step.frames)
                        ratios.append(contact.area_px / step.true_px)
                        peers.append(np.count_nonzero(peer(mean_image(step.frames))) / step.true_px)
                        told = contact.flags & {Flag.CUT_BY_BORDER, Flag.LOW_CONFIDENCE, Flag.UNDECIDED}
                        untold += ratios[-1] < 1 - LARGE_ERROR and not told
        low, middle, high = np.quantile(ratios, (0.1, 0.5, 0.9))
        small, small_peers = (sum(ratio < 1 - LARGE_ERROR for ratio in some) for some in (ratios, peers))
        lines.append(
            f"| {place} | {len(ratios)} | {low:.2f}, {middle:.2f}, {high:.2f} | {small} | {untold} "
            f"| {np.median(peers):.2f} | {small_peers} |"
        )
    return lines
