"""`station analyze` through the command line."""

import contextlib
import logging
import os
import pty
import resource
import shutil
import socket
import struct
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from station.calibration.model import Calibration, FieldMap, Noise
from station.calibration.store import CalibrationStore
from tests.tables import read_table

WITHOUT_COVERAGE = {name: value for name, value in os.environ.items() if not name.startswith("COV")}
"""The environment of a program whose files are limited in size: the coverage's own file would be, too."""

HEADER = ["image", "contact", "area_px", "area_mm2", "centroid_x_px", "centroid_y_px", "flags"]


def test_a_folder_gives_rows_masks_sheet_and_report(press, analyze_apart, tmp_path):
    out = tmp_path / "out"
    done = analyze_apart("--reference", press.reference, "--method", "paper", "--out", out, press.folder)
    assert (done.returncode, done.stderr) == (0, "")
    rows = read_table(out / "results.csv")
    assert list(rows[0]) == HEADER
    assert [row["image"] for row in rows] == [f"frame_{number}.png" for number in range(7, 13)]
    for row in rows[1:]:
        mask = cv2.imread(str(out / "masks" / row["image"]), cv2.IMREAD_UNCHANGED)
        assert mask is not None
        assert mask.shape == (320, 240)
        assert set(np.unique(mask)) <= {0, 255}
        assert np.count_nonzero(mask) == int(row["area_px"])
        assert int(row["area_px"]) == pytest.approx(press.areas_px[row["image"]], rel=0.25)
        assert float(row["area_mm2"]) == pytest.approx(int(row["area_px"]) * (0.0266 * 2) ** 2, rel=1e-3)
        assert (float(row["centroid_x_px"]), float(row["centroid_y_px"])) == pytest.approx((120, 160), abs=4)
        assert row["contact"] == "1"
    assert (out / "contact_sheet.png").exists()
    assert not (out / "stages").exists()


@pytest.mark.parametrize(
    ("measured", "mm_per_px", "whose"),
    [(False, 0.0255, ", not measured by calibration "), (True, 0.028, ", calibration ")],
)
def test_a_unit_whose_calibration_measured_no_scale_has_the_sites_as_at_the_station(
    press, analyze, tmp_path, monkeypatch, measured, mm_per_px, whose
):
    monkeypatch.setenv("STATION_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("STATION_CAMERA_MM_PER_PX", "0.0255")
    calibration = Calibration(
        id="20260102T030405Z", serial="D20001", unit="digit", operator="anna", simulated=True, program="0",
        ball_mm=24.0, holder_mm=18.0, width_px=240, height_px=320, mm_per_px=0.028,
        scale_uncertainty=0.02, scale_measured=measured, places=(), curve=(), onset_mm=42.0, zero_mm=0.0,
        noise=Noise(pixel_levels=(1.0, 1.0, 1.0), gate=0.5, gate_factor=1.0, drift_levels=1.0),
        light_levels=(90.0, 90.0, 90.0), sharpness_levels=2.0,
        field=FieldMap(rows=1, columns=1, light_levels=((90.0, 90.0, 90.0),), noise_levels=(1.0,)), checks=(),
    )  # fmt: skip
    CalibrationStore(tmp_path / "home").add_calibration(calibration, {})
    out = tmp_path / "out"
    image = press.folder / "frame_10.png"
    done = analyze("--reference", press.reference, "--method", "paper", "--unit", "D20001", "--out", out, image)
    assert done.returncode == 0, done.stderr
    (row,) = read_table(out / "results.csv")
    assert float(row["area_mm2"]) == pytest.approx(int(row["area_px"]) * mm_per_px**2, rel=1e-3)
    assert f"{mm_per_px:.4f} mm per pixel{whose}{calibration.id} of D20001" in (out / "report.html").read_text()


def test_widths_add_closing_curve_and_plot(press, analyze, tmp_path):
    out = tmp_path / "out"
    (press.folder / "frame_7.png").unlink()
    done = analyze(
        "--reference", press.reference, "--method", "paper", "--widths", press.widths, "--out", out, press.folder
    )
    assert done.returncode == 0, done.stderr
    curve = read_table(out / "curve.csv")
    assert [float(row["closing_mm"]) for row in curve] == [0, 1, 2, 3, 4]
    assert [float(row["width_mm"]) for row in curve] == [38, 37, 36, 35, 34]
    areas = [float(row["area_mm2"]) for row in curve]
    assert areas == sorted(areas)
    assert "closing, mm" in (out / "curve.svg").read_text()


def test_stages_are_the_papers_three_rows_with_the_denoising_figures(press, analyze, tmp_path):
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--stages", "--out", out, press.folder)
    assert done.returncode == 0, done.stderr
    for number, name in enumerate(("difference", "denoised", "segmented"), start=1):
        assert (out / "stages" / f"frame_12_{number}_{name}.png").exists()
    assert (out / "stages.png").exists()
    figures = read_table(out / "denoising.csv")
    assert len(figures) == 6
    assert all(10 < float(row["psnr_db"]) < 60 and 0 < float(row["ssim"]) < 1 for row in figures)


def test_the_results_do_not_depend_on_the_number_of_jobs(press, analyze, tmp_path):
    tables = []
    for jobs in (1, 3):
        out = tmp_path / f"jobs{jobs}"
        arguments = ("--reference", press.reference, "--method", "paper", "--jobs", jobs, "--out", out, press.folder)
        assert analyze(*arguments).returncode == 0
        tables.append((out / "results.csv").read_bytes())
    assert tables[0] == tables[1]


def test_a_video_is_measured_frame_by_frame(press, analyze, tmp_path):
    video = tmp_path / "close.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 10, (240, 320))
    for number in range(7, 13):
        writer.write(np.asarray(cv2.imread(str(press.folder / f"frame_{number}.png"))))
    writer.release()
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, video)
    assert done.returncode == 0, done.stderr
    rows = read_table(out / "results.csv")
    assert [row["image"] for row in rows] == [f"close_{index:05d}" for index in range(6)]
    assert int(rows[5]["area_px"]) == pytest.approx(press.areas_px["frame_12.png"], rel=0.25)


def test_grey_16_bit_and_transparent_images_are_converted_and_say_so(press, analyze, tmp_path):
    image = np.asarray(cv2.imread(str(press.folder / "frame_12.png")))
    odd = tmp_path / "odd"
    odd.mkdir()
    cv2.imwrite(str(odd / "alpha.png"), cv2.cvtColor(image, cv2.COLOR_BGR2BGRA))
    cv2.imwrite(str(odd / "deep.png"), image.astype(np.uint16) * 257)
    cv2.imwrite(str(odd / "grey.png"), image[:, :, 1])
    cv2.imwrite(str(odd / "plain.png"), image)
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, odd)
    assert done.returncode == 0, done.stderr
    alpha, deep, grey, plain = read_table(out / "results.csv")
    assert alpha["area_px"] == deep["area_px"] == plain["area_px"]
    assert ["converted" in row["flags"] for row in (alpha, deep, grey, plain)] == [True, True, True, False]
    report = (out / "report.html").read_text()
    for words in ("transparency dropped", "16 bits scaled to 8", "grey spread to three channels"):
        assert words in report


def spoil_truncated(folder: Path) -> Path:
    path = folder / "bad.jpg"
    cv2.imwrite(str(path), np.asarray(cv2.imread(str(folder / "frame_9.png"))))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


def spoil_text(folder: Path) -> Path:
    path = folder / "bad.png"
    path.write_text("this is no image")
    return path


def spoil_empty(folder: Path) -> Path:
    path = folder / "bad.png"
    path.touch()
    return path


def spoil_size(folder: Path) -> Path:
    path = folder / "bad.png"
    cv2.imwrite(str(path), np.zeros((100, 100, 3), np.uint8))
    return path


def spoil_missing(folder: Path) -> Path:
    return folder / "bad.png"


def spoil_second_page(folder: Path) -> Path:
    """A TIFF whose second page has no dimensions."""
    path = folder / "bad.tif"
    cv2.imwrite(str(path), np.zeros((320, 240, 3), np.uint8))
    content = path.read_bytes()
    (first,) = struct.unpack("<I", content[4:8])
    after = first + 2 + 12 * struct.unpack("<H", content[first : first + 2])[0]
    page = struct.pack("<HHHIII", 1, 269, 2, 1, 0, 0)
    path.write_bytes(content[:after] + struct.pack("<I", len(content)) + content[after + 4 :] + page)
    return path


def spoil_chunk(folder: Path) -> Path:
    """A PNG with a chunk of 4 GB by its length, behind the pixels."""
    path = folder / "bad.png"
    cv2.imwrite(str(path), np.zeros((320, 240, 3), np.uint8))
    content = path.read_bytes()
    path.write_bytes(content[:-12] + struct.pack(">I4s", 0xFF00304B, b"juNk") + content[-12:])
    return path


def spoil_video(folder: Path) -> Path:
    path = folder / "bad.mp4"
    path.write_bytes(b"\x00\x00\x00\x18ftypmp42" + bytes(500))
    return path


def spoil_folder(folder: Path) -> Path:
    path = folder / "bad"
    path.mkdir()
    return path


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (spoil_truncated, "damaged or cut short"),
        (spoil_text, "not an image"),
        (spoil_empty, "the file is empty"),
        (spoil_size, "the reference has 240x320"),
        (spoil_missing, "there is no such file"),
        (spoil_second_page, "damaged or cut short"),
        (spoil_chunk, "damaged or cut short"),
        (spoil_video, "no frame of this video can be decoded"),
        (spoil_folder, "the folder has no images"),
    ],
)
def test_one_bad_image_costs_exit_code_2_and_no_other_result(
    press, analyze, analyze_apart, tmp_path, caplog, spoil, words
):
    # FFmpeg takes its log level once a process.
    run = analyze_apart if spoil is spoil_video else analyze
    bad = spoil(press.folder)
    first, last = press.folder / "frame_9.png", press.folder / "frame_12.png"
    out = tmp_path / "out"
    done = run("--reference", press.reference, "--method", "paper", "--out", out, first, bad, last)
    assert done.returncode == 2
    assert words in done.stderr
    assert [line for line in done.stderr.splitlines() if not line.startswith("station: ")] == []
    # Printed by a process without pytest.
    assert [record for record in caplog.records if record.levelno >= logging.WARNING] == []
    assert "bad" in done.stderr
    assert [row["image"] for row in read_table(out / "results.csv")] == ["frame_9.png", "frame_12.png"]
    (error,) = read_table(out / "errors.csv")
    assert words in error["error"]
    assert words in (out / "report.html").read_text()


def test_a_playlist_in_place_of_a_video_asks_nobody(press, analyze, tmp_path):
    """As the bill of materials states of the TLS library that OpenCV brings for FFmpeg's network protocols."""
    video = press.folder / "bad.mp4"
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        address = f"http://127.0.0.1:{server.getsockname()[1]}/video.ts"
        video.write_text(f"#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\n{address}\n#EXT-X-ENDLIST\n")
        for source in (video, f"http://127.0.0.1:{server.getsockname()[1]}/video.mp4"):
            done = analyze("--reference", press.reference, "--method", "paper", "--out", tmp_path / "out", source)
            assert done.returncode == 2
        with pytest.raises(BlockingIOError):
            server.accept()


@pytest.mark.parametrize("spoil", [spoil_text, spoil_missing, spoil_folder])
def test_where_nothing_can_be_measured_no_folder_is_left(press, analyze, tmp_path, spoil):
    out = tmp_path / "new" / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, spoil(press.folder))
    assert done.returncode == 2
    assert not out.exists()


@pytest.mark.parametrize("spoil", [spoil_truncated, spoil_text, spoil_missing, spoil_folder])
def test_a_bad_reference_is_refused_before_anything_is_written(press, analyze, tmp_path, spoil):
    bad = spoil(press.folder)
    out = tmp_path / "out"
    done = analyze("--reference", bad, "--method", "paper", "--out", out, press.folder / "frame_9.png")
    assert done.returncode == 2
    assert str(bad) in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()


@pytest.mark.parametrize("method", ["robust", "paper"])
def test_a_black_reference_is_refused_before_anything_is_written(press, analyze, tmp_path, method):
    """Also one whose few bright pixels are gone in the median."""
    frames, out = tmp_path / "black", tmp_path / "out"
    frames.mkdir()
    for number in range(3):
        frame = np.zeros_like(cv2.imread(str(press.reference)))
        frame[0, number] = 255
        cv2.imwrite(str(frames / f"{number}.png"), frame)
    done = analyze("--reference", frames, "--method", method, "--out", out, press.folder / "frame_9.png")
    assert done.returncode == 2
    assert f"{frames}: the reference is black" in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()


def test_an_earlier_result_is_never_mixed_with_a_new_one(press, analyze, tmp_path):
    out = tmp_path / "out"
    arguments = ("--reference", press.reference, "--method", "paper", "--out", out, press.folder / "frame_9.png")
    assert analyze(*arguments).returncode == 0
    before = (out / "results.csv").read_bytes()
    done = analyze(*arguments)
    assert done.returncode == 2
    assert "holds an earlier result" in done.stderr
    assert (out / "results.csv").read_bytes() == before


def test_an_output_that_cannot_be_made_is_refused(press, analyze, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    for out in (file, file / "below"):
        done = analyze("--reference", press.reference, "--method", "paper", "--out", out, press.folder)
        assert done.returncode == 2
        assert "cannot be written" in done.stderr
        assert file.read_text() == "mine"


def test_a_disk_that_fills_up_keeps_what_was_measured(press, analyze_apart, tmp_path):
    """The limit on a file's size simulates a full disk: the last, noisy stage does not fit any more."""
    out = tmp_path / "out"
    noise = np.random.default_rng(0).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    cv2.imwrite(str(press.folder / "frame_13.png"), noise)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    done = analyze_apart(
        "--reference", press.reference, "--method", "paper", "--stages", "--jobs", 1, "--out", out, press.folder,
        preexec_fn=limit, env=WITHOUT_COVERAGE,
    )  # fmt: skip
    assert done.returncode == 2
    assert "cannot be written" in done.stderr
    assert "results so far are kept" in done.stderr
    assert "Traceback" not in done.stderr
    rows = read_table(out / "results.csv")
    assert len(rows) >= 6
    assert all((out / "masks" / row["image"]).is_file() for row in rows)
    assert all(cv2.imread(str(picture)) is not None for picture in out.rglob("*.png"))


def test_a_mask_that_does_not_fit_the_disk_leaves_no_row(press, analyze_apart, tmp_path):
    out = tmp_path / "out"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (400, 400))

    done = analyze_apart(
        "--reference", press.reference, "--method", "paper", "--out", out, press.folder / "frame_9.png",
        preexec_fn=limit, env=WITHOUT_COVERAGE,
    )  # fmt: skip
    assert done.returncode == 2
    assert "frame_9.png: cannot be written" in done.stderr
    assert not out.exists()


def test_on_a_terminal_a_bar_shows_how_far_it_is(press, tmp_path):
    ours, theirs = pty.openpty()
    arguments = ("--reference", press.reference, "--method", "paper", "--out", tmp_path / "out", press.folder)
    command = [sys.executable, "-m", "station", "analyze", *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=theirs, timeout=90, check=False)
    os.close(theirs)
    shown = b""
    with contextlib.suppress(OSError):  # the end of a terminal
        while part := os.read(ours, 4096):
            shown += part
    os.close(ours)
    assert done.returncode == 0
    assert b"measuring" in shown
    assert b"100%" in shown


def test_a_row_is_written_whole_or_not_at_all(press, analyze_apart, tmp_path):
    """The limit falls into the table itself: no half row may stay."""
    for number in range(30):
        shutil.copy(press.folder / "frame_7.png", press.folder / f"{'long_' * 38}{number}.png")
    out = tmp_path / "out"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, 5_000))

    done = analyze_apart(
        "--reference", press.reference, "--method", "paper", "--out", out, press.folder,
        preexec_fn=limit, env=WITHOUT_COVERAGE,
    )  # fmt: skip
    assert done.returncode == 2
    assert "results.csv: cannot be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert (out / "results.csv").stat().st_size > 4_000
    assert all(row["flags"] is not None for row in read_table(out / "results.csv"))
    assert (out / "results.csv").read_bytes().endswith(b"\r\n")


def test_two_images_that_would_share_a_mask_are_refused(press, analyze, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    shutil.copy(press.folder / "frame_9.png", other)
    done = analyze(
        "--reference", press.reference, "--method", "paper", "--out", tmp_path / "out",
        press.folder / "frame_9.png", other / "frame_9.png",
    )  # fmt: skip
    assert done.returncode == 2
    assert "would both write masks/frame_9.png" in done.stderr


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("image;width_mm\nframe_9.png;3\n", ":1: expected the header image,width_mm"),
        ("image,width_mm\nframe_9.png,wide\n", ":2: width_mm: expected a number from 0 to 200 mm, found 'wide'"),
        ("image,width_mm\nframe_9.png,nan\n", ":2: width_mm: expected a number"),
        ("image,width_mm\nframe_9.png,3\nframe_9.png,4\n", ":3: image: frame_9.png is listed twice"),
        ("image,width_mm\nframe_10.png,3\n", "no width for frame_9.png"),
        ("image,width_mm\n", "expected a row for each image"),
        ("image,width_mm\n\xff", "expected UTF-8"),
    ],
)
def test_a_bad_table_of_widths_is_named_by_its_line(press, analyze, tmp_path, table, words):
    widths = tmp_path / "bad.csv"
    widths.write_bytes(table.encode("latin-1"))
    done = analyze(
        "--reference", press.reference, "--method", "paper", "--widths", widths, "--out", tmp_path / "out",
        press.folder / "frame_9.png",
    )  # fmt: skip
    assert done.returncode == 2
    assert words in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_of_untouched_frames_serves_as_reference(press, analyze, tmp_path):
    frames = tmp_path / "untouched"
    frames.mkdir()
    for number in range(3):
        shutil.copy(press.reference, frames / f"untouched_{number}.png")
    done = analyze("--reference", frames, "--method", "paper", "--out", tmp_path / "out", press.folder / "frame_9.png")
    assert done.returncode == 0, done.stderr
    assert "median of 3 images" in (tmp_path / "out" / "report.html").read_text()


def test_a_folder_passes_over_the_reference_and_other_files(press, analyze, tmp_path):
    (press.folder / "notes.txt").write_text("mine")
    reference = press.folder / "reference.png"
    shutil.copy(press.reference, reference)
    done = analyze("--reference", reference, "--method", "paper", "--out", tmp_path / "out", press.folder)
    assert done.returncode == 0
    assert "not measured: notes.txt, reference.png" in done.stderr
    assert len(read_table(tmp_path / "out" / "results.csv")) == 6


@pytest.mark.parametrize("arguments", [(), ("--reference", "x"), ("--out", "x", "--reference", "y"), ("--jobs", "0")])
def test_bad_usage_is_exit_code_2_with_a_hint(analyze, arguments):
    done = analyze(*arguments)
    assert done.returncode == 2
    assert "Usage:" in done.stderr


def test_a_long_series_is_shown_on_several_sheets(press, analyze, tmp_path):
    for number in range(44):
        shutil.copy(press.folder / "frame_12.png", press.folder / f"more_{number}.png")
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--stages", "--out", out, press.folder)
    assert done.returncode == 0, done.stderr
    for name in ("contact_sheet.png", "contact_sheet_2.png", "stages.png", "stages_5.png"):
        picture = cv2.imread(str(out / name))
        assert picture is not None, name
    assert not (out / "stages_6.png").exists()
    assert (out / "report.html").read_text().count("The stages of each image") == 5


@pytest.mark.parametrize("shape", [(32, 3000), (3000, 32)])
def test_an_image_of_odd_proportions_is_measured_and_shown(analyze, tmp_path, shape):
    reference = tmp_path / "reference.png"
    cv2.imwrite(str(reference), np.full((*shape, 3), 90, np.uint8))
    shutil.copy(reference, tmp_path / "image.png")
    out = tmp_path / "out"
    done = analyze("--reference", reference, "--method", "paper", "--stages", "--out", out, tmp_path / "image.png")
    assert done.returncode == 0, done.stderr
    assert (out / "report.html").exists()


def test_names_that_are_no_text_or_too_long_cost_nobody_else_his_result(press, analyze, tmp_path):
    odd = os.fsencode(press.folder) + b"/odd_\xff.png"
    shutil.copy(press.folder / "frame_9.png", odd)
    shutil.copy(press.folder / "frame_9.png", press.folder / f"{'x' * 240}.png")
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, press.folder, "y" * 300)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "the name is too long" in done.stderr
    assert "yyy: cannot be read: File name too long" in done.stderr
    names = [row["image"] for row in read_table(out / "results.csv")]
    assert len(names) == 7
    assert "odd_\\xff.png" in names


def test_an_image_that_is_missing_needs_no_width(press, analyze, tmp_path):
    out = tmp_path / "out"
    done = analyze(
        "--reference", press.reference, "--method", "paper", "--widths", press.widths, "--out", out,
        press.folder / "frame_9.png", press.folder / "gone.png", press.folder / "frame_12.png",
    )  # fmt: skip
    assert done.returncode == 2
    assert [row["image"] for row in read_table(out / "curve.csv")] == ["frame_9.png", "frame_12.png"]
    assert [row["image"] for row in read_table(out / "errors.csv")] == ["gone.png"]


def test_without_any_contact_it_is_said_that_there_is_no_curve(press, analyze, tmp_path):
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--widths", press.widths, "--out", out, press.folder / "frame_7.png")
    assert done.returncode == 0
    assert "no image shows more than a light touch" in done.stderr
    assert not (out / "curve.csv").exists()
    assert "there is no onset, and so no curve" in (out / "report.html").read_text()


def test_a_table_of_widths_that_is_no_file_is_refused_at_once(press, analyze, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for widths in (pipe, "/dev/zero"):
        done = analyze(
            "--reference", press.reference, "--widths", widths, "--out", tmp_path / "out", press.folder / "frame_9.png"
        )
        assert done.returncode == 2
        assert "expected a CSV file" in done.stderr


def test_a_converted_reference_is_said(press, analyze, tmp_path):
    grey = tmp_path / "grey.png"
    cv2.imwrite(str(grey), np.asarray(cv2.imread(str(press.reference), cv2.IMREAD_GRAYSCALE)))
    out = tmp_path / "out"
    done = analyze("--reference", grey, "--method", "paper", "--out", out, press.folder / "frame_9.png")
    assert done.returncode == 0
    assert "reference converted: grey spread to three channels" in done.stderr
    assert "grey spread to three channels" in (out / "report.html").read_text()


def test_a_video_that_is_cut_short_is_measured_as_far_as_it_goes(press, analyze, tmp_path):
    video = tmp_path / "close.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 10, (240, 320))
    for number in range(7, 13):
        writer.write(np.asarray(cv2.imread(str(press.folder / f"frame_{number}.png"))))
    writer.release()
    video.write_bytes(video.read_bytes()[: video.stat().st_size * 2 // 3])
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, video)
    assert done.returncode == 2
    assert "of 6 frames could be decoded" in done.stderr
    assert 1 <= len(read_table(out / "results.csv")) < 6


def test_the_sites_own_recipes_are_found(press, analyze_apart, tmp_path):
    done = analyze_apart(
        "--reference", press.reference, "--recipe", "cherry", "--out", tmp_path / "out", press.folder,
        env={**os.environ, "STATION_RECIPES_FOLDER": str(tmp_path / "none")},
    )  # fmt: skip
    assert done.returncode == 2
    assert str(tmp_path / "none") in done.stderr


def test_a_full_standard_output_is_told_without_a_traceback(press, analyze, tmp_path):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "station", "recipes", "check"], stdout=full, stderr=subprocess.PIPE, text=True,
            timeout=60, check=False,
        )  # fmt: skip
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "No space left" in done.stderr
