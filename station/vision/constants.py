"""Constants of the robust method: each with its unit, its pixel grid, its meaning and its origin.

Grids: `working` is the image averaged down to 320 pixels on its long side, `half` is that divided by two. A length in
pixels of one grid is written on that grid only. Origins: `fit` was chosen by `./run bench fit` on the data named there;
`measured` was read off real images. A number that a module declares may also be a resolution: how finely something is
computed, and finer changes nothing that the fit's data show. `docs/robust-constants.md` has what it costs to change
each.
"""

from dataclasses import dataclass, field
from typing import Any, Literal

Grid = Literal["working", "half", ""]
NORMAL_OF_MEDIAN = 1.4826
"""A normal distribution's standard deviation over its median absolute deviation."""

_BY_LEVELS = "fit: of the level at which the union has the true area, on one part's fruit; held against the other's"
_BY_TRIALS = "fit: by trials on 200 tuning presses, not by the search; held against `--check`"


def constant(value: float, unit: str, meaning: str, origin: str, grid: Grid = "") -> Any:
    """Declare a constant with what a reader has to know of it.

    Args:
        value: the default.
        unit: of the value; "" for a plain ratio.
        meaning: what it does, for the table.
        origin: `fit`, `fit: …` or `measured: …`.
        grid: the pixel grid that a length in pixels belongs to.
    """
    return field(default=value, metadata={"unit": unit, "grid": grid, "meaning": meaning, "origin": origin})


@dataclass(frozen=True, slots=True)
class Constants:
    """Every number that decides how the robust method measures, beside the recipe's own parameters."""

    # Reference and input
    lit_share: float = constant(0.25, "of the brightest colour's mean", "a colour below it has no light", "fit")
    most_drift_share: float = constant(
        0.35, "of the light", "more drift is another light: an LED is off, or the camera", "measured: drift 0.05"
    )
    saturated_share: float = constant(
        0.05, "of a contact", "from here on it is flagged as saturated", "measured: none on real presses"
    )
    # Background model
    light_prior: float = constant(
        5.0, "of a cell's noise", "prior standard deviation of the lowest cosine and of a border band", "fit"
    )
    displacement_prior: float = constant(
        1.0, "px", "the same of the pattern's displacement, for each grey level of a cell's noise", "fit", "working"
    )
    band_reach: float = constant(0.07, "of the side", "a border band falls by e over this length", "fit")
    known_share: float = constant(0.2, "of the frame", "with less background the priors are drawn in", "fit")
    most_spread: float = constant(8.0, "grey level", "the background's residual is never taken as larger", "fit")
    calm_ratio: float = constant(2.2, "", "background bends less than this times the calmest twentieth", "fit")
    calm_limit: float = constant(1.6, "of least_bend", "background never bends more", "fit")
    stripe_prior: float = constant(0.03, "of a line's cells", "prior of a row's or column's offset", "fit")
    pattern_blur: float = constant(
        4.0, "px", "smoothing of the reference whose displacement is fitted", "fit", "working"
    )
    # Detection
    curvature_blur: float = constant(5.0, "px", "smoothing before the slopes", "fit", "working")
    curvature_window: float = constant(7.5, "px", "window of the structure tensor", "fit", "working")
    sure_gate: float = constant(2.5, "of the threshold", "from here on contact is sure, below it is faint", "fit")
    wide_share: float = constant(0.3, "of the frame", "a body so large curves the gel evenly", "fit")
    wide_levels: float = constant(
        6.0, "grey level", "and moves so much of it as far", "measured: 4.6 untouched at JPEG 30"
    )
    wide_threshold: float = constant(0.6, "of the threshold", "is enough for such a body", "fit")
    # Candidates
    level_window: float = constant(3.0, "px", "window of the change's level", "fit", "half")
    candidate_share: float = constant(0.5, "of the strong level", "a place from here on belongs to a candidate", "fit")
    # Region
    region_window: float = constant(0.08, "of the radius", "window of the level", "fit")
    cap_quantile: float = constant(0.38, "", "quantile of the region's level at which the gain is capped", "fit")
    share_even: float = constant(
        0.85,
        "of the cap",
        "the region's end where directions are random and elements as strong as the body",
        _BY_TRIALS,
    )
    share_coherent: float = constant(1.6, "of the cap", "how much higher it is per unit of coherence", "fit")
    share_prominent: float = constant(
        0.5,
        "of the cap",
        "how much higher it is per e-fold of prominence",
        _BY_TRIALS,
    )
    least_prominence: float = constant(
        -1.7, "ln(1/px)", "a smoother body counts as one of this", "measured: raspberries"
    )
    share_least: float = constant(
        0.3,
        "of the cap",
        "the region's end is never lower",
        _BY_TRIALS,
    )
    share_field: float = constant(-0.2, "of the cap", "how much lower it is per share of the field", "fit")
    share_most: float = constant(0.76, "of the cap", "the region's end is never higher", "fit")
    region_span: float = constant(1.9, "radii", "how far beyond its start the region is looked for", "fit")
    path_stiffness: float = constant(0.05, "", "price of a jump of the region's outline", "fit")
    hull_share: float = constant(0.8, "of the hull", "within it a flat centre costs nothing", "fit")
    flat_field_floor: float = constant(0.6, "of the mean light", "limits the flat-field correction in the dark", "fit")
    flat_field_blur: float = constant(4.0, "px", "smoothing of the light for the flat-field correction", "fit", "half")
    # Texture
    coherence_window: float = constant(0.13, "of the radius", "window of the coherence", "fit")
    skin_left_out: float = constant(0.25, "of the region", "the weakest places say nothing of the texture", "fit")
    smooth_small: float = constant(0.6, "", "coherence from which a small body is smooth", "fit")
    smooth_at_one: float = constant(1.36, "", "the same, extrapolated to a radius of one pixel", "fit")
    smooth_per_size: float = constant(0.222, "per e-fold of the radius", "how it falls with the radius", "fit")
    halo_over_least: float = constant(1.5, "of the least curvature", "the halo curves no more", "fit")
    halo_curvature: float = constant(0.5, "grey level/px", "nor more than this", "fit")
    curved_quantile: float = constant(0.6, "", "quantile of the region's curvature at which the gain is clipped", "fit")
    curved_share: float = constant(0.28, "of that", "where the curved region ends", "fit")
    fine_on_skin: float = constant(
        0.105, "grey level/px", "fine share times curvature, from which a body without background is skin", "fit"
    )
    coarse_blur: float = constant(12.0, "px", "what is coarser is the body's own slope", "fit", "half")
    element_random: float = constant(
        0.04, "of the strong change", "level of an element where directions are random", "fit"
    )
    element_coherent: float = constant(0.72, "of the strong change", "how much higher per unit of coherence", "fit")
    element_lone: float = constant(
        0.46, "of the strong change", "the same of a lone element, half its height", _BY_LEVELS
    )
    few_elements_px: float = constant(
        5000.0, "px", "area of a region beyond which its elements are many", _BY_LEVELS, "working"
    )
    half_sure: float = constant(
        0.38, "", "logarithm of the areas at two levels at which the confidence is halved", "fit"
    )
    # Contour
    strong_quantile: float = constant(0.75, "", "quantile of the rays' falls that is called strong", "fit")
    least_steepness: float = constant(0.4, "of a strong fall", "a fall below it is no edge", "fit")
    highest_harmonic: float = constant(3.0, "", "of the start's radius around the circle", "fit")
    border_chord: float = constant(
        0.65, "of the extent", "a contact that reaches so far along a border is mirrored", "fit"
    )
    corner_chord: float = constant(0.4, "of the extent", "the same about a corner", "fit")
    # Weak contact
    weak_threshold: float = constant(
        6.9, "of the noise", "a touch stands out by this", "measured: none of 11,040 untouched frames"
    )
    weak_most_of_fine: float = constant(
        0.25,
        "",
        "variance of the slopes over that of the fine noise, from which on compression shows",
        "measured: a DIGIT's noise 0.16, with a contact of 5 mm² 0.3, compressed images 0.4 and more",
    )
    weak_least_curvature: float = constant(
        0.3,
        "of the threshold",
        "curvature that a weak contact shows too",
        "measured: of 1,025 untouched frames 2 show less",
    )
    # Press
    released_share: float = constant(0.5, "of the load's change", "below it the body has been let go", "fit")
    confirmed_share: float = constant(
        0.9, "of the last area", "the next step confirms a contact that it contains", "fit"
    )
    # Witness
    witness_most: float = constant(4.5, "of the contact area", "more changed than this is a disagreement", "fit")
    witness_least: float = constant(0.1, "of the contact area", "less changed than this is a disagreement", "fit")
    # Confidence
    reliable_ratio: float = constant(
        4.0, "times the noise", "drop at which the confidence is one half; less is no change", "fit"
    )
    support_least: float = constant(
        0.06, "", "confidence below which an outline is dropped", "measured: 0.05 untouched at JPEG 30"
    )
    one_colour: float = constant(0.85, "of the change's power", "a change of one colour is dirt or shadow", "fit")


CONSTANTS = Constants()
"""As shipped."""
