"""A press is one measurement: its images are measured in order, each with the contact of the step before."""

import random
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from station.analysis.analysis import Request, analyze
from station.analysis.decoding import Decoded
from station.analysis.measurement import Measured, Refused
from station.analysis.output import OutputFolder
from station.analysis.presses import Run, runs
from station.analysis.sources import Source, list_sources
from station.settings.recipe import find_recipe
from station.settings.segmentation import Segmentation
from station.twin.digit.press import render_press
from station.twin.fruit import Kind
from station.vision.contact import Contact, StageSink, contact_from_mask
from station.vision.median import median_image
from station.vision.methods import make_method
from station.vision.press import PressTracker
from station.vocabulary import Flag
from tests.tables import read_table

CLOSINGS_MM = (-2.0, -1.0, 0.5, 1.5, 2.5, 3.5, 4.5)
BLUEBERRY = find_recipe("blueberry")


@pytest.fixture(scope="module")
def pressed():
    """A blueberry's press on the twin: the first two images show nothing."""
    return render_press("blueberry", 5, CLOSINGS_MM)


@pytest.fixture
def folder(pressed, tmp_path: Path) -> Path:
    """The press as files: reference/, step_0.png and so on, and widths.csv."""
    (tmp_path / "reference").mkdir()
    (tmp_path / "frames").mkdir()
    for number, image in enumerate(pressed.references):
        cv2.imwrite(str(tmp_path / "reference" / f"{number}.png"), image)
    rows = ["image,width_mm"]
    for number, (image, width_mm) in enumerate(zip(pressed.frames, pressed.widths_mm, strict=True)):
        cv2.imwrite(str(tmp_path / "frames" / f"step_{number}.png"), image)
        rows.append(f"step_{number}.png,{width_mm:.3f}")
    (tmp_path / "widths.csv").write_text("\n".join(rows) + "\n")
    return tmp_path


def add_press(place: Path, kind: Kind, seed: int) -> Path:
    """Write another fruit's press as a second folder of images, of the same sensor, and its rows into the widths."""
    frames = place / "second"
    frames.mkdir()
    press = render_press(kind, seed, CLOSINGS_MM)
    with (place / "widths.csv").open("a") as table:
        for number, (image, width_mm) in enumerate(zip(press.frames, press.widths_mm, strict=True)):
            cv2.imwrite(str(frames / f"second_{number}.png"), image)
            table.write(f"second_{number}.png,{width_mm:.3f}\n")
    return frames


def followed(references: Sequence[np.ndarray], frames: Sequence[np.ndarray]) -> list[Contact]:
    """The contacts of frames that are measured as one press."""
    segmentation = BLUEBERRY.segmentation
    tracker = PressTracker(make_method(median_image(references), segmentation))
    return [tracker.measure_step([frame]) for frame in frames]


def same(rows: Sequence[dict[str, str]], contacts: Sequence[Contact]) -> bool:
    return [(int(row["contact"]), int(row["area_px"])) for row in rows] == [
        (int(contact.found), contact.area_px) for contact in contacts
    ]


def test_images_with_widths_are_one_press_in_the_order_of_falling_width(pressed, folder, analyze):
    images = [folder / "frames" / f"step_{number}.png" for number in range(len(CLOSINGS_MM))]
    random.Random(3).shuffle(images)
    tables = []
    for jobs in (1, 3):
        out = folder / f"out{jobs}"
        done = analyze(
            "--reference", folder / "reference", "--recipe", "blueberry", "--widths", folder / "widths.csv",
            "--jobs", jobs, "--out", out, *images,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
        tables.append((out / "results.csv").read_bytes())
    assert tables[0] == tables[1]
    rows = read_table(folder / "out1" / "results.csv")
    assert list(rows[0]) == ["image", "contact", "area_px", "area_mm2", "centroid_x_px", "centroid_y_px", "flags"]
    assert [row["image"] for row in rows] == [image.name for image in images], "rows are in the order given"
    contacts = followed(pressed.references, pressed.frames)
    in_time = sorted(rows, key=lambda row: row["image"])
    assert same(in_time, contacts)
    assert [row["contact"] for row in in_time] == ["0", "0", "1", "1", "1", "1", "1"]
    details = {row["image"]: row for row in read_table(folder / "out1" / "details.csv")}
    assert list(details["step_3.png"]) == ["image", "confidence", "gate", "drift_levels", "changed_area_px"]
    written = [details[f"step_{number}.png"]["changed_area_px"] for number in range(len(contacts))]
    assert written == ["" if one.changed_area_px is None else str(one.changed_area_px) for one in contacts]
    report = (folder / "out1" / "report.html").read_text()
    assert "1 press of 7 images" in report
    assert [float(row["closing_mm"]) for row in read_table(folder / "out1" / "curve.csv")] == pytest.approx(
        [closing - 0.5 for closing in CLOSINGS_MM], abs=0.01
    )


def test_a_press_goes_on_after_an_image_that_cannot_be_decoded(pressed, folder, analyze):
    (folder / "frames" / "step_3.png").write_text("no image")
    out = folder / "out"
    done = analyze(
        "--reference", folder / "reference", "--recipe", "blueberry", "--sequence", "--stages", "--out", out,
        folder / "frames",
    )  # fmt: skip
    assert done.returncode == 2
    assert [row["image"] for row in read_table(out / "errors.csv")] == ["step_3.png"]
    rows = read_table(out / "results.csv")
    assert [row["image"] for row in rows] == [f"step_{number}.png" for number in (0, 1, 2, 4, 5, 6)]
    assert same(rows, followed(pressed.references, [*pressed.frames[:3], *pressed.frames[4:]]))
    assert sorted(path.name for path in (out / "stages").glob("step_6_*"))
    assert not (out / "curve.csv").exists()


def test_each_video_is_a_press_of_its_own(pressed, folder, analyze):
    videos = [folder / "first.avi", folder / "second.avi"]
    for video in videos:
        height, width = pressed.frames[0].shape[:2]
        writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 10, (width, height))
        for frame in pressed.frames:
            writer.write(frame)
        writer.release()
    out = folder / "out"
    done = analyze("--reference", folder / "reference", "--recipe", "blueberry", "--out", out, *videos)
    assert done.returncode == 0, done.stderr
    rows = read_table(out / "results.csv")
    capture = cv2.VideoCapture(str(videos[0]))
    frames = [np.asarray(capture.read()[1], np.uint8) for _ in pressed.frames]
    capture.release()
    contacts = followed(pressed.references, frames)
    assert same(rows[:7], contacts)
    assert same(rows[7:], contacts)
    assert "2 presses of 7, 7 images" in (out / "report.html").read_text()


@pytest.mark.parametrize(("kind", "seed"), [("strawberry", 5), ("blueberry", 6)])
def test_presses_of_one_table_of_widths_have_a_curve_each_as_if_analysed_alone(folder, analyze, kind, seed):
    second = add_press(folder, kind, seed)
    for out, images in (("both", [folder / "frames", second]), ("alone", [second])):
        done = analyze(
            "--reference", folder / "reference", "--recipe", "blueberry", "--widths", folder / "widths.csv",
            "--out", folder / out, *images,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
    rows = read_table(folder / "both" / "curve.csv")
    assert [(row["press"], row["image"]) for row in rows] == [
        *(("1", f"step_{number}.png") for number in range(7)),
        *(("2", f"second_{number}.png") for number in range(7)),
    ]
    for press in (rows[:7], rows[7:]):
        touched = [float(row["closing_mm"]) for row in press if float(row["area_mm2"])]
        assert touched[0] == 0
    assert {row["expected_mm2"] for row in rows} == {""}
    alone = read_table(folder / "alone" / "curve.csv")
    assert list(alone[0]) == [
        "image", "width_mm", "closing_mm", "area_px", "area_mm2", "expected_mm2", "press",
    ]  # fmt: skip
    assert alone == [row | {"press": "1"} for row in rows[7:]]
    both, one = ((folder / out / "report.html").read_text() for out in ("both", "alone"))
    assert "does not fit the other steps" not in both
    assert (both.count(">press 1, width "), both.count(">press 2, width ")) == (7, 7)
    assert ">press 1, width " not in one
    onsets = [next(row["width_mm"] for row in press if row["closing_mm"] == "0.000") for press in (rows[:7], rows[7:])]
    plot = (folder / "both" / "curve.svg").read_text()
    assert [plot.count(f">press {number}: onset at {mm} mm<") for number, mm in enumerate(onsets, start=1)] == [1, 1]
    assert plot.count('<polyline class="curve curve-own"') == 2
    plot = (folder / "alone" / "curve.svg").read_text()
    assert f">onset at {onsets[1]} mm<" in plot
    assert plot.count('<polyline class="curve curve-own"') == plot.count('<polyline class="curve curve-changed"') == 1
    assert 'class="press-1"' not in plot


def source(name: str, place: int = -1, *, video: bool = False, refused: bool = False) -> Source:
    return Source(name, name, lambda: Decoded(np.zeros((64, 64, 3), np.uint8), ()), refused, place, from_video=video)


def by_name(sources: Sequence[Source], order: Sequence[Run]) -> list[str]:
    """Each press's names, an exclamation mark before an image that is measured by itself."""
    return [("" if run.followed else "!") + "".join(sources[number].name for number in run.numbers) for run in order]


@pytest.mark.parametrize(
    ("widths", "sequence", "expected"),
    [
        ((9, 8, 7, 6, 5), False, ["abcde"]),
        ((7, 9, 8, 5, 6), False, ["bcaed"]),
        ((5, 6, 7, 8, 9), False, ["edcba"]),
        ((9, 8, 8, 8, 7), False, ["abcde"]),
        ((9, 8, 7, 8, 9), False, ["abc", "d", "e"]),
        ((9, 7, 5, 9.04, 7), False, ["abc", "de"]),
        ((7, 9, 8, 5, 6), True, ["a", "bcd", "e"]),
        (None, True, ["abcde"]),
        (None, False, ["!a", "!b", "!c", "!d", "!e"]),
    ],
)
def test_a_press_ends_where_the_jaws_open(widths, sequence, expected):
    sources = [source(name) for name in "abcde"]
    table: dict[str, float] | None = None if widths is None else dict(zip("abcde", widths, strict=True))
    assert by_name(sources, runs(sources, table, sequence=sequence)) == expected


@pytest.mark.parametrize("sequence", [False, True])
@pytest.mark.parametrize(
    ("widths_mm", "lengths"),
    [
        ((40.06, 40.04, 40.06, 39.02, 39.01, 39.02, 38.0, 38.0, 38.0), [9]),
        ((40.0, 40.1, 39.0, 39.1, 38.3, 38.4), [6]),
        ((40.0, 39.0, 40.0), [2, 1]),
        ((40.06, 39.02, 39.01, 39.02, 40.04, 40.05, 39.0), [4, 3]),
    ],
)
def test_a_width_that_is_read_several_times_is_no_opening_of_the_jaws(widths_mm, lengths, sequence):
    sources = [source(f"{number}") for number in range(len(widths_mm))]
    table: dict[str, float] = {each.name: width_mm for each, width_mm in zip(sources, widths_mm, strict=True)}
    assert [len(run.numbers) for run in runs(sources, table, sequence=sequence)] == lengths


def test_a_press_in_steps_of_a_tenth_of_a_millimetre_is_one_in_any_order_of_its_names():
    names = "abcdefghijkl"
    steps = (0, 9, 10, 11, 1, 2, 3, 4, 5, 6, 7, 8)
    table: dict[str, float] = {name: 40 - 0.1 * step for name, step in zip(names, steps, strict=True)}
    sources = [source(name) for name in names]
    assert by_name(sources, runs(sources, table, sequence=False)) == ["aefghijklbcd"]


def test_videos_folders_and_files_are_presses_of_their_own():
    sources = [
        source("a"), source("B", 1), source("C", 1), source("d"), source("?", refused=True), source("E", 3, video=True),
        source("F", 3, video=True),
    ]  # fmt: skip
    assert by_name(sources, runs(sources, None, sequence=False)) == ["!a", "!B", "!C", "!d", "!?", "EF"]
    assert by_name(sources, runs(sources, None, sequence=True)) == ["ad", "BC", "!?", "EF"]
    table: dict[str, float] = dict(zip("aBCdEF", (4, 5, 6, 9, 2, 3), strict=True))
    assert by_name(sources, runs(sources, table, sequence=False)) == ["da", "CB", "!?", "E", "F"]


class Stub:
    """A method whose contact grows with the image's brightness, and whose edge is lost in the brightest."""

    stages: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.calls: list[tuple[int, int | None]] = []
        """The brightness, and the area of the step before."""

    def measure(self, image: np.ndarray, on_stage: StageSink | None = None, previous: Contact | None = None) -> Contact:
        level = int(image[0, 0, 0])
        self.calls.append((level, None if previous is None else previous.area_px))
        mask = np.zeros(image.shape[:2], np.uint8)
        mask[20 : 20 + level // 10, 20:30] = 255
        flags = frozenset({Flag.LOWER_BOUND}) if level > 150 else frozenset[Flag]()
        return contact_from_mask(mask, flags, confidence=0.9, changed_area_px=2 * level)


def test_the_report_shows_the_changed_area_and_marks_lower_bounds(tmp_path: Path, monkeypatch):
    for number, level in enumerate((0, 50, 100, 200)):
        cv2.imwrite(str(tmp_path / f"step_{number}.png"), np.full((64, 64, 3), level, np.uint8))
    stub = Stub()
    monkeypatch.setattr("station.analysis.analysis.make_method", lambda *_: stub)
    request = Request(
        sources=list_sources([tmp_path]).sources,
        references=[Decoded(np.zeros((64, 64, 3), np.uint8), ())],
        reference_name="reference",
        segmentation=Segmentation(),
        recipe=None,
        widths_mm={f"step_{number}.png": 40.0 - number for number in range(4)},
        out=tmp_path / "out",
        stages=False,
        jobs=2,
    )
    assert analyze(request, lambda: None).measured == 4
    assert stub.calls == [(0, None), (50, 0), (100, 50), (200, 100)]
    report = (tmp_path / "out" / "report.html").read_text()
    assert report.count("at least this large") == 1
    assert report.count("<span>at least ") == 1
    assert report.count(">changed area ") == 4
    plot = (tmp_path / "out" / "curve.svg").read_text()
    assert "changed area" in plot
    assert "lower bound: the contact is at least this large" in plot
    results = read_table(tmp_path / "out" / "results.csv")
    assert [row["flags"] for row in results] == ["no_contact", "", "", "lower_bound"]
    assert [row["contact"] for row in results] == ["0", "1", "1", "1"]
    details = read_table(tmp_path / "out" / "details.csv")
    assert [row["changed_area_px"] for row in details] == ["0", "100", "200", "400"]


def test_paper_measures_each_image_by_itself(tmp_path: Path, monkeypatch):
    for number, level in enumerate((50, 100, 120)):
        cv2.imwrite(str(tmp_path / f"step_{number}.png"), np.full((64, 64, 3), level, np.uint8))
    stub = Stub()
    monkeypatch.setattr("station.analysis.analysis.make_method", lambda *_: stub)
    request = Request(
        sources=list_sources([tmp_path]).sources,
        references=[Decoded(np.zeros((64, 64, 3), np.uint8), ())],
        reference_name="reference",
        segmentation=Segmentation(method="paper"),
        recipe=None,
        widths_mm=None,
        out=tmp_path / "out",
        stages=False,
        jobs=1,
        sequence=True,
    )
    assert analyze(request, lambda: None).measured == 3
    assert stub.calls == [(50, None), (100, None), (120, None)]


@pytest.mark.parametrize("method", ["paper", "robust"])
def test_each_closing_of_the_jaws_has_its_own_curve_by_either_method(tmp_path: Path, monkeypatch, method):
    """Three presses in one folder, the second without a contact, and the third with an area that does not fit."""
    levels, widths_mm = (0, 50, 100, 0, 0, 60, 120, 90), (40, 39, 38, 40, 39, 40, 39, 38)
    for number, level in enumerate(levels):
        cv2.imwrite(str(tmp_path / f"step_{number}.png"), np.full((64, 64, 3), level, np.uint8))
    monkeypatch.setattr("station.analysis.analysis.make_method", lambda *_: Stub())
    request = Request(
        sources=list_sources([tmp_path]).sources,
        references=[Decoded(np.zeros((64, 64, 3), np.uint8), ())],
        reference_name="reference",
        segmentation=Segmentation(method=method),
        recipe=None,
        widths_mm={f"step_{number}.png": float(width_mm) for number, width_mm in enumerate(widths_mm)},
        out=tmp_path / "out",
        stages=False,
        jobs=1,
    )
    assert analyze(request, lambda: None).measured == 8
    rows = read_table(tmp_path / "out" / "curve.csv")
    assert [(row["image"], row["press"], row["closing_mm"], bool(row["expected_mm2"])) for row in rows] == [
        ("step_0.png", "1", "-1.000", False),
        ("step_1.png", "1", "0.000", False),
        ("step_2.png", "1", "1.000", False),
        ("step_5.png", "3", "0.000", False),
        ("step_6.png", "3", "1.000", True),
        ("step_7.png", "3", "2.000", False),
    ]
    report = (tmp_path / "out" / "report.html").read_text()
    assert report.count("area does not fit the other steps") == 1
    assert report.count(">press 2, width ") == 2
    plot = (tmp_path / "out" / "curve.svg").read_text()
    assert [plot.count(f">press {words}<") for words in ("1: onset at 39 mm", "2: no onset", "3: onset at 40 mm")] == [
        1, 1, 1,
    ]  # fmt: skip


def test_a_curve_has_each_image_beside_its_own_area_where_a_read_width_rises_a_little(tmp_path: Path, monkeypatch):
    widths_mm = (40.04, 40.06, 39.02, 38.0)
    for number, level in enumerate((50, 60, 100, 120)):
        cv2.imwrite(str(tmp_path / f"step_{number}.png"), np.full((64, 64, 3), level, np.uint8))
    monkeypatch.setattr("station.analysis.analysis.make_method", lambda *_: Stub())
    request = Request(
        sources=list_sources([tmp_path]).sources,
        references=[Decoded(np.zeros((64, 64, 3), np.uint8), ())],
        reference_name="reference",
        segmentation=Segmentation(),
        recipe=None,
        widths_mm={f"step_{number}.png": width_mm for number, width_mm in enumerate(widths_mm)},
        out=tmp_path / "out",
        stages=False,
        jobs=1,
        sequence=True,
    )
    assert analyze(request, lambda: None).measured == 4
    rows = read_table(tmp_path / "out" / "curve.csv")
    assert [(row["image"], row["width_mm"], row["area_px"], row["press"]) for row in rows] == [
        ("step_1.png", "40.06", "60", "1"),
        ("step_0.png", "40.04", "50", "1"),
        ("step_2.png", "39.02", "100", "1"),
        ("step_3.png", "38", "120", "1"),
    ]


def test_rows_come_in_the_order_given_and_none_is_lost_where_the_run_ends_early(tmp_path: Path):
    def measured(number: int) -> Measured:
        image = np.zeros((64, 64, 3), np.uint8)
        return Measured(source(f"{number}.png"), number, image, contact_from_mask(image[:, :, 0]), ())

    out = tmp_path / "out"

    def called_off() -> None:
        with OutputFolder(out) as output:
            for number in (3, 1):
                output.add(measured(number), 0.0)
            assert not (out / "results.csv").exists()
            output.skip(Refused(source("0.png"), 0, "no image"))
            assert [row["image"] for row in read_table(out / "results.csv")] == ["1.png"]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        called_off()
    assert [row["image"] for row in read_table(out / "results.csv")] == ["1.png", "3.png"]
