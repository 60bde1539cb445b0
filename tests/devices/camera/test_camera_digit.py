import asyncio
import threading
import time

import cv2
import numpy as np
import pytest

from station.devices.camera.digit import (
    DigitCamera,
    DigitDevice,
    captured_at_s,
    find_digits,
    packed_leds,
    set_mode,
    to_portrait,
)
from station.devices.camera.interface import CameraError, FrameFault, Leds, NoCameraError
from station.devices.camera.probe import probe_camera
from station.messages import camera as messages
from station.settings.camera import CameraSettings, DigitSettings


def plug(root, node, usb_id, serial, index="0", revision="0200"):
    """Lay out sysfs as the kernel does: class entries are links into the device tree."""
    usb = root / "devices" / f"usb-{serial}"
    video = usb / f"{usb.name}:1.0" / "video4linux" / node
    video.mkdir(parents=True)
    vendor, product = usb_id.split(":")
    for name, text in (("idVendor", vendor), ("idProduct", product), ("serial", serial), ("bcdDevice", revision)):
        (usb / name).write_text(f"{text}\n", encoding="ascii")
    (video / "index").write_text(f"{index}\n", encoding="ascii")
    (video / "device").symlink_to(video.parent.parent)
    listing = root / "class" / "video4linux"
    listing.mkdir(parents=True, exist_ok=True)
    (listing / node).symlink_to(video)
    return listing


def test_sensors_are_found_by_vendor_product_and_serial(tmp_path):
    plug(tmp_path, "video0", "046d:0825", "WEBCAM")
    plug(tmp_path, "video10", "2833:0209", "D20003")
    plug(tmp_path, "video2", "2833:0209", "D20966")
    listing = plug(tmp_path, "video3", "2833:0209", "D20966", index="1")
    assert find_digits(listing) == [
        DigitDevice("D20966", "/dev/video2", "0200"),
        DigitDevice("D20003", "/dev/video10", "0200"),
    ]
    assert find_digits(tmp_path / "nowhere") == []


@pytest.mark.parametrize(("leds", "value"), [(Leds(15, 15, 15), 0xFFF), (Leds(1, 2, 3), 0x123), (Leds(0, 0, 0), 0)])
def test_lights_are_packed_four_bits_each(leds, value):
    assert packed_leds(leds) == value


@pytest.mark.parametrize("leds", [Leds(16, 0, 0), Leds(0, -1, 0)])
def test_a_light_out_of_range_is_refused(leds):
    with pytest.raises(ValueError, match="expected 0 to 15"):
        packed_leds(leds)


def test_landscape_becomes_portrait_by_a_quarter_turn():
    landscape = np.random.default_rng(0).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    portrait = to_portrait(landscape)
    assert portrait.shape == (640, 480, 3)
    assert np.array_equal(portrait, np.rot90(landscape))


class FakeCapture:
    """A V4L2 device that gives noise, stops after some frames, and remembers what was set."""

    def __init__(self, frames=10**9, width=640.0):
        self.left, self.properties, self.width, self.released = frames, {}, width, False
        self.stamp_s = 0.0

    def isOpened(self):  # noqa: N802
        return True

    def set(self, prop, value):
        self.properties[prop] = value
        return True

    def get(self, prop):
        read_only = {cv2.CAP_PROP_FRAME_WIDTH: self.width, cv2.CAP_PROP_POS_MSEC: 1000 * self.stamp_s}
        return read_only[prop] if prop in read_only else self.properties[prop]

    def read(self):
        time.sleep(0.005)
        self.left -= 1
        image = np.random.default_rng(self.left % 1000).integers(60, 90, (480, 640, 3), dtype=np.uint8)
        return self.left >= 0, image

    def release(self):
        self.released = True


def test_the_mode_is_asked_for_in_full_and_the_kernels_buffers_stay_as_they_are():
    capture = FakeCapture()
    set_mode(capture, "D20966")
    assert capture.properties == {
        cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*"YUYV"),
        cv2.CAP_PROP_FRAME_WIDTH: 640,
        cv2.CAP_PROP_FRAME_HEIGHT: 480,
        cv2.CAP_PROP_FPS: 30,
    }


def test_a_mode_other_than_asked_for_is_an_error():
    with pytest.raises(CameraError) as caught:
        set_mode(FakeCapture(width=320.0), "D20966")
    assert caught.value.message.id == messages.WRONG_MODE.id
    wanted, given = ("width", "height", "rate"), ("given_width", "given_height", "given_rate")
    assert [caught.value.message.parameters[name] for name in (*wanted, *given)] == [640, 480, 30, 320, 480, 30]


def test_frames_are_portrait_and_a_lost_sensor_is_found_again_by_its_serial(tmp_path):
    listing = plug(tmp_path, "video4", "2833:0209", "D20966")
    opened = []

    def opener(node):
        opened.append((node, FakeCapture(frames=10)))
        return opened[-1][1]

    async def play():
        settings = CameraSettings(driver="digit", digit=DigitSettings(serial="D20966", green=9))
        camera = DigitCamera(settings, listing, opener)
        await camera.open()
        assert camera.description.revision == "0200"
        while len(opened) < 2:
            assert (await camera.frame(time.monotonic(), 20.0)).image.shape == (640, 480, 3)
        await camera.frame(time.monotonic(), 20.0)
        assert opened[1][1].properties[cv2.CAP_PROP_ZOOM] == 0xF9F
        await camera.set_leds(Leds(1, 2, 3))
        for _ in range(2):
            await camera.frame(time.monotonic(), 20.0)
        await camera.close()
        await camera.close()

    asyncio.run(play())
    assert {node for node, _ in opened} == {"/dev/video4"}
    assert all(capture.released for _, capture in opened)
    assert opened[0][1].properties[cv2.CAP_PROP_ZOOM] == 0xF9F
    assert opened[-1][1].properties[cv2.CAP_PROP_ZOOM] == 0x123


class DarkCapture(FakeCapture):
    """One that does not take its light's setting."""

    def set(self, prop, value):
        super().set(prop, value)
        return prop != cv2.CAP_PROP_ZOOM


@pytest.mark.parametrize(
    ("revision", "capture", "notice"),
    [
        ("0200", FakeCapture, None),
        ("0110", FakeCapture, messages.LIGHT_FIRMWARE(revision="0200")),
        ("0200", DarkCapture, messages.LIGHT_REFUSED()),
    ],
)
def test_a_light_that_cannot_be_set_is_told(tmp_path, monkeypatch, revision, capture, notice):
    listing = plug(tmp_path, "video0", "2833:0209", "D20966", revision=revision)
    monkeypatch.setattr(
        "station.devices.camera.probe.camera_from", lambda one: DigitCamera(one, listing, lambda _: capture())
    )
    [finding] = asyncio.run(probe_camera(CameraSettings(driver="digit", digit=DigitSettings(serial="D20966"))))
    if notice:
        assert (finding.verdict, finding.remedy) == ("warning", notice)
    else:
        assert finding.remedy is None or finding.remedy.id == messages.REMEDY_SLOW.id


class ThrowingCapture(FakeCapture):
    """One whose reading ends in an exception of OpenCV's own."""

    def read(self):
        if not self.left:
            raise cv2.error("select() failed")
        return super().read()


def test_an_exception_of_opencvs_costs_one_opening_and_not_the_thread(tmp_path):
    listing = plug(tmp_path, "video4", "2833:0209", "D20966")
    opened = []

    def opener(_node):
        opened.append(ThrowingCapture(frames=3))
        return opened[-1]

    async def play():
        camera = DigitCamera(CameraSettings(driver="digit"), listing, opener)
        await camera.open()
        while len(opened) < 3:
            assert (await camera.frame(time.monotonic(), 20.0)).image.shape == (640, 480, 3)
        await camera.close()

    asyncio.run(play())
    assert all(capture.released for capture in opened)


class StampedCapture(FakeCapture):
    """One whose frames began to come in half a second ago, as after a stall of the reading thread."""

    def read(self):
        self.stamp_s = time.monotonic() - 0.5
        return super().read()


def test_a_frame_has_the_time_at_which_it_came_in_and_a_queued_one_does_not_pass_for_new(tmp_path):
    listing = plug(tmp_path, "video4", "2833:0209", "D20966")

    async def play():
        settings = CameraSettings(driver="digit", open_deadline_s=20.0)
        camera = DigitCamera(settings, listing, lambda _: StampedCapture())
        await camera.open()
        requested_s = time.monotonic()
        frame = await camera.frame(requested_s, 20.0)
        read_s = time.monotonic()
        await camera.close()
        return requested_s, frame, read_s

    requested_s, frame, read_s = asyncio.run(play())
    assert requested_s < frame.captured_s <= read_s - 0.5, "captured after it was requested, long before it was read"
    assert FrameFault.STALE in frame.faults


@pytest.mark.parametrize(
    ("stamp_s", "captured_s"),
    [(999.95, 999.95), (1000.0, 1000.0), (995.0, 995.0), (1000.1, 1000.0), (0.0, 1000.0), (1.7e9, 1000.0)],
)
def test_the_kernels_time_is_taken_unless_it_is_of_another_clock(stamp_s, captured_s):
    capture = FakeCapture()
    capture.stamp_s = stamp_s
    assert captured_at_s(capture, 1000.0) == pytest.approx(captured_s)


class HungCapture(FakeCapture):
    """One whose reading hangs until the test ends it, as OpenCV's wait for a frame does for 10 s."""

    def __init__(self):
        super().__init__()
        self.let_go, self.returned = threading.Event(), False

    def read(self):
        self.let_go.wait(8.0)
        self.returned = True
        return super().read()


def test_a_sensor_that_hangs_is_an_error_before_its_reading_returns_and_is_used_once_it_sends(tmp_path):
    listing = plug(tmp_path, "video4", "2833:0209", "D20966")
    capture = HungCapture()

    async def play():
        camera = DigitCamera(CameraSettings(driver="digit", open_deadline_s=0.05), listing, lambda _: capture)
        for _ in range(2):
            with pytest.raises(NoCameraError):
                await camera.open()
        assert not capture.returned
        capture.let_go.set()
        assert (await camera.frame(0.0, 20.0)).image.shape == (640, 480, 3)
        await camera.open()
        await camera.close()

    asyncio.run(play())
    assert capture.released


def test_no_such_sensor_is_said_with_those_that_are_there(tmp_path):
    listing = plug(tmp_path, "video4", "2833:0209", "D20003")

    async def play():
        camera = DigitCamera(CameraSettings(driver="digit", open_deadline_s=0.2), listing)
        with pytest.raises(NoCameraError) as caught:
            await camera.open()
        await camera.close()
        reason = caught.value.message.parameters["reason"]
        assert reason == messages.NOT_PLUGGED_IN(serial="D20966", found="D20003")

    asyncio.run(play())
