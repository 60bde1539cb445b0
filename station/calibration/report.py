"""Report of a calibration or a verification, and the files that are stored with it."""

import cv2

from station.calibration.calibration_procedure import Draft, Evidence
from station.calibration.model import Calibration, Refusal
from station.calibration.plots import area_plot, field_plot
from station.calibration.store import PAGE, REFERENCE, press_name
from station.calibration.verification_procedure import VerificationResult, outlined
from station.charts.report import data_uri, templates
from station.vision.contact import Image

_TILE_PX = 220


def calibration_files(draft: Draft) -> dict[str, bytes]:
    """Return the pictures and the page of a calibration, by file name."""
    calibration = draft.calibration
    area, field = area_plot(calibration), field_plot(calibration.field)
    presses = {press_name(number): png(step.image) for number, step in enumerate(draft.steps)}
    tiles = [
        (f"{step.width_mm:.2f} mm", _area(calibration, step.contact.area_px), _tile(outlined(step)))
        for step in draft.steps
    ]
    page = _page(
        title=f"Calibration {calibration.id} of {calibration.serial}",
        verdict=None,
        facts=_calibration_facts(calibration),
        checks=[(check, None) for check in calibration.checks],
        plots=[
            ("The ball's area over the width", data_uri(area)),
            ("Light and noise over the field, as the image shows it", data_uri(field)),
        ],
        tiles=[("untouched", "reference", _tile(draft.reference)), *tiles],
    )
    return {REFERENCE: png(draft.reference), "area.png": area, "field.png": field, **presses, PAGE: page}


def verification_files(verified: VerificationResult, calibration: Calibration) -> dict[str, bytes]:
    """Return the pictures and the page of a verification, by file name."""
    verification = verified.verification
    area = area_plot(calibration, verification.curve)
    pictures = {name: png(picture) for name, picture in verified.pictures.items()}
    tiles = [
        (
            f"{point.width_mm:.2f} mm",
            _area(calibration, point.area_px),
            _tile(verified.pictures[press_name(number)]),
        )
        for number, point in enumerate(verification.curve)
    ]
    page = _page(
        title=f"Verification {verification.id} of {verification.serial}",
        verdict=verification.passed,
        facts=[
            ("Unit", calibration.unit),
            ("Calibration", str(calibration.summary())),
            ("Operator", verification.operator or "not given"),
            ("Made", f"{verification.made_at:%Y-%m-%d %H:%M:%S} UTC"),
        ],
        checks=[(check, data_uri(pictures[check.picture]) if check.picture else None) for check in verification.checks],
        plots=[("The ball's area over the width", data_uri(area))],
        tiles=[("untouched", "now", _tile(verified.reference)), *tiles],
    )
    return {REFERENCE: png(verified.reference), "area.png": area, **pictures, PAGE: page}


def refusal_files(refusal: Refusal, evidence: Evidence) -> dict[str, bytes]:
    """Return the pictures and the page of a refused calibration, by file name."""
    reference = evidence.reference
    pictures = {} if reference is None else {REFERENCE: png(reference)}
    pictures |= {press_name(number): png(step.image) for number, step in enumerate(evidence.steps)}
    untouched = [] if reference is None else [("untouched", "reference", _tile(reference))]
    tiles = [
        (f"{step.width_mm:.2f} mm", f"{step.contact.area_px} px", _tile(outlined(step))) for step in evidence.steps
    ]
    page = _page(
        title=f"Refused calibration {refusal.id} of {refusal.serial}",
        verdict=False,
        facts=[
            ("Unit", refusal.unit),
            ("Operator", refusal.operator or "not given"),
            ("Made", f"{refusal.made_at:%Y-%m-%d %H:%M:%S} UTC"),
            *(("Refused", str(reason)) for reason in refusal.reasons),
        ],
        checks=[(check, None) for check in refusal.checks],
        plots=[],
        tiles=[*untouched, *tiles],
    )
    return {**pictures, PAGE: page}


def png(picture: Image) -> bytes:
    """Encode a picture, shape (height, width, 3), dtype uint8, as a PNG file."""
    return cv2.imencode(".png", picture)[1].tobytes()


def _calibration_facts(calibration: Calibration) -> list[tuple[str, str]]:
    how = (
        f"measured with the ball at {len(calibration.places)} places"
        if calibration.scale_measured
        else "not measured: the usual scale of such sensors; calibrate with --place to measure it"
    )
    noise = calibration.noise
    return [
        ("Unit", f"{calibration.unit}{', simulated' if calibration.simulated else ''}"),
        ("Operator", calibration.operator or "not given"),
        ("Made", f"{calibration.made_at:%Y-%m-%d %H:%M:%S} UTC, fruit-station {calibration.program}"),
        ("Scale", f"{calibration.mm_per_px:.5f} mm/px ± {calibration.scale_uncertainty:.1%}, {how}"),
        ("Areas", f"in mm² good to {calibration.area_uncertainty:.1%}, beside what repeating an image differs by"),
        ("Ball", f"{calibration.ball_mm:g} mm, its holder takes {calibration.holder_mm:g} mm"),
        ("Onset", f"{calibration.onset_mm:.2f} mm; the gripper's zero is off by {calibration.zero_mm:+.2f} mm"),
        ("Noise", " / ".join(f"{level:.2f}" for level in noise.pixel_levels) + " grey levels in blue / green / red"),
        ("Gate", f"reaches {noise.gate:.2f} with nothing touching; this unit's factor is {noise.gate_factor:.2f}"),
        (
            "Light",
            " / ".join(f"{level:.0f}" for level in calibration.light_levels) + " grey levels in blue / green / red",
        ),
    ]


def _area(calibration: Calibration, area_px: int) -> str:
    return f"{area_px * calibration.mm_per_px**2:.1f} mm²" if area_px else "no contact"


def _page(**values: object) -> bytes:
    return templates("station.calibration").get_template("report.html.j2").render(**values).encode()


def _tile(picture: Image) -> str:
    height, width = picture.shape[:2]
    small = cv2.resize(picture, (_TILE_PX, round(_TILE_PX * height / width)), interpolation=cv2.INTER_AREA)
    return data_uri(cv2.imencode(".jpg", small)[1].tobytes())
