"""An image whose area is unknown is no point of the curve."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from station.analysis.analysis import Request, analyze
from station.analysis.decoding import Decoded
from station.analysis.sources import list_sources
from station.settings.segmentation import Segmentation
from station.vision.contact import Contact, contact_from_mask
from station.vocabulary import Flag


class Stub:
    """A method that finds a disc in bright images and cannot decide on dark ones."""

    stages: tuple[str, ...] = ()

    def measure(self, image: np.ndarray, on_stage: object = None, previous: Contact | None = None) -> Contact:
        mask = np.zeros(image.shape[:2], np.uint8)
        if image.mean() < 50:
            return Contact(mask, 0, None, frozenset({Flag.UNDECIDED}), confidence=0.0)
        cv2.circle(mask, (30, 30), int(image.mean() // 10), 255, -1)
        return contact_from_mask(mask, confidence=0.9)


def test_an_undecided_image_is_told_and_left_out_of_the_curve(tmp_path: Path, monkeypatch):
    for number, level in enumerate((100, 20, 200)):
        cv2.imwrite(str(tmp_path / f"step_{number}.png"), np.full((64, 64, 3), level, np.uint8))
    monkeypatch.setattr("station.analysis.analysis.make_method", lambda *_: Stub())
    captions: list[str] = []

    def sheet(columns: Sequence[tuple[str, Sequence[np.ndarray]]], _row_names: Sequence[str]) -> np.ndarray:
        captions.extend(caption for caption, _ in columns)
        return np.zeros((9, 9, 3), np.uint8)

    monkeypatch.setattr("station.analysis.analysis.sheet", sheet)
    request = Request(
        sources=list_sources([tmp_path]).sources,
        references=[Decoded(np.zeros((64, 64, 3), np.uint8), ())],
        reference_name="reference",
        segmentation=Segmentation(),
        recipe=None,
        widths_mm={f"step_{number}.png": 40.0 - number for number in range(3)},
        out=tmp_path / "out",
        stages=False,
        jobs=1,
    )
    assert analyze(request, lambda: None).measured == 3
    curve = (tmp_path / "out" / "curve.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in curve[1:]] == ["step_0.png", "step_2.png"]
    assert "undecided" in (tmp_path / "out" / "results.csv").read_text()
    assert [caption.endswith("area unknown") for caption in captions] == [False, True, False]
    assert "unknown: something bends the gel" in (tmp_path / "out" / "report.html").read_text()
