"""Segmentation settings of a recipe: the method and its parameters."""

from typing import Literal, Self

from pydantic import model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting

LARGEST_GATE_RATIO, LARGEST_LEAST_BEND = 20.0, 10.0
"""No gate ratio, and no minimum curvature response in grey levels per pixel, may be larger. Estimates."""


class PaperParameters(Settings):
    """Parameters of the pipeline as printed in Computers and Electronics in Agriculture 235 (2025) 110397."""

    amplification: float = setting(
        10.0,
        title="Amplification",
        description="Factor on the colour difference to the reference; the paper prints 10.",
        ge=1.0,
        le=50.0,
    )
    denoise_h: float = setting(
        20.0,
        title="Denoising strength, brightness",
        description="Filter strength h of the non-local means for brightness; the paper prints 20.",
        unit="grey level",
        ge=0.0,
        le=100.0,
    )
    denoise_h_color: float = setting(
        21.0,
        title="Denoising strength, colour",
        description="Filter strength hColor of the non-local means for colour; the paper prints 21.",
        unit="grey level",
        ge=0.0,
        le=100.0,
    )
    template_window_px: int = setting(
        21,
        title="Template window",
        description="Side of the compared patches. The paper prints 20; OpenCV needs an odd side, so 21.",
        unit="px",
        ge=1,
        le=61,
    )
    search_window_px: int = setting(
        7,
        title="Search window",
        description="Side of the window that is searched for like patches; the paper prints 7.",
        unit="px",
        ge=1,
        le=61,
    )
    clusters: int = setting(
        2,
        title="Clusters",
        description="Number of K-means clusters; the brightest is taken as contact. The paper prints 2.",
        ge=2,
        le=8,
    )
    kmeans_starts: int = setting(
        10,
        title="K-means starts",
        description="Random starts of which the most compact wins; not printed in the paper, common practice.",
        ge=1,
        le=50,
    )
    kernel_px: int = setting(
        3,
        title="Morphology kernel",
        description="Side of the square kernel of the closing and the opening; the paper prints 3x3.",
        unit="px",
        ge=1,
        le=51,
    )
    smallest_component_px: int = setting(
        5000,
        title="Smallest component",
        description="Components below this are dropped; printed for 640x480 and scaled with the image's area.",
        unit="px",
        ge=0,
        le=307_200,
    )
    seed: int = setting(
        0,
        title="Seed",
        description="Seed of the K-means starts, so that the same image always gives the same mask.",
        ge=0,
        le=2**31 - 1,
    )

    @model_validator(mode="after")
    def _windows_have_a_centre(self) -> Self:
        """Refuse even windows: OpenCV silently takes the next odd one, and an even kernel shifts the mask."""
        even = [
            ((name,), messages.EVEN_SIDE(side_px=side_px))
            for name in ("template_window_px", "search_window_px", "kernel_px")
            if (side_px := getattr(self, name)) % 2 == 0
        ]
        return self.accepted(*even)


class RobustParameters(Settings):
    """Parameters of the station's own method; pixels are those of a 640x480 image and scale with the image."""

    contacts: Literal["one", "several"] = setting(
        "one",
        title="Contacts",
        description="`one` outlines one body, seeds, drupelets and all; `several` measures separate contacts each.",
    )
    gate_ratio: float = setting(
        3.0,
        title="Gate",
        description="Contact is searched where the curvature response exceeds the background's median by this factor.",
        ge=1.5,
        le=LARGEST_GATE_RATIO,
    )
    least_bend: float = setting(
        0.15,
        title="Minimum curvature response",
        description="A curvature response below this is never contact, however small the image's noise: "
        "light drifts by as much.",
        unit="grey level/px",
        ge=0.01,
        le=LARGEST_LEAST_BEND,
    )
    smallest_contact_px: int = setting(
        500,
        title="Smallest contact",
        description="Contacts below this are dropped; 500 px of 640x480 are about 0.35 mm².",
        unit="px",
        ge=0,
        le=307_200,
    )
    edge_stiffness: float = setting(
        0.1,
        title="Edge stiffness",
        description="Smoothness of the edge: the higher, the longer the bridged gaps, where the light shows no fall.",
        ge=0.0,
        le=2.0,
    )
    least_confidence: float = setting(
        0.5,
        title="Least confidence",
        description="Below this confidence an area is flagged.",
        ge=0.0,
        le=1.0,
    )


class Segmentation(Settings):
    """Segmentation method of a recipe, with the parameters of both methods for comparison."""

    method: Literal["robust", "paper"] = setting(
        "robust",
        title="Method",
        description="`robust` is the station's own method, `paper` the published pipeline as printed, "
        "for analyses and studies: it gives no confidence, and inspections refuse it.",
    )
    paper: PaperParameters = setting(
        PaperParameters(),
        title="Paper's parameters",
        description="Used when the paper's method is chosen.",
    )
    robust: RobustParameters = setting(
        RobustParameters(),
        title="Robust parameters",
        description="Used when the robust method is chosen.",
    )
