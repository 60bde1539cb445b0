import asyncio
import time

import cv2
import numpy as np
import pytest

from station.devices.camera.interface import CameraError, NoCameraError, NoFrameError
from station.devices.camera.open import camera_from
from station.devices.camera.probe import probe_camera
from station.devices.camera.replay import ReplayCamera
from station.messages import camera as messages
from station.settings.camera import CameraSettings, ReplaySettings


def settings(source, **more):
    return CameraSettings(driver="replay", replay=ReplaySettings(source=str(source), **more))


@pytest.fixture
def recording(tmp_path):
    """A folder of twelve images, each of one grey level."""
    for number in range(12):
        noise = np.random.default_rng(number).integers(0, 9, (64, 48, 3))
        cv2.imwrite(str(tmp_path / f"frame_{number}.png"), (noise + 20 * number + 20).clip(0, 240).astype(np.uint8))
    return tmp_path


def levels(frames):
    return [round((float(frame.image.mean()) - 24) / 20) for frame in frames]


def test_as_fast_as_asked_each_image_comes_once_in_natural_order(recording):

    async def play():
        camera = camera_from(settings(recording, frames_per_s=None))
        assert isinstance(camera, ReplayCamera)
        for _ in range(2):
            await camera.open()
            frames = [await camera.frame(time.monotonic(), 1.0) for _ in range(12)]
            assert levels(frames)[:11] == list(range(11))
            assert camera.description.height_px == 64
            with pytest.raises(NoFrameError) as caught:
                await camera.frame(time.monotonic(), 1.0)
            reasons = caught.value.message.parameters["reasons"]
            assert isinstance(reasons, tuple)
            assert messages.REPLAY_ENDED() in reasons
            assert caught.value.message.parameters["remedy"] == messages.REMEDY_REPLAY()
            await camera.close()

    asyncio.run(play())


def test_in_real_time_the_rate_is_kept_and_frames_pass_unseen(recording):

    async def play():
        camera = ReplayCamera(settings(recording, frames_per_s=20.0))
        await camera.open()
        began_s = time.monotonic()
        seen = [await camera.frame(began_s, 2.0)]
        while seen[-1].sequence < 12:
            seen.append(await camera.frame(seen[-1].captured_s, 2.0))
        # Eleven further frames at 20 a second.
        assert time.monotonic() - began_s >= 0.5
        with pytest.raises(NoFrameError):
            await camera.frame(time.monotonic(), 0.1)
        await camera.close()

    asyncio.run(play())


def test_a_video_is_a_recording(tmp_path):
    path = tmp_path / "press.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (48, 64))
    for number in range(5):
        writer.write(np.full((64, 48, 3), 40 * number + 20, np.uint8))
    writer.release()

    async def play():
        camera = ReplayCamera(settings(path, frames_per_s=None))
        await camera.open()
        means = [(await camera.frame(0.0, 1.0)).image.mean() for _ in range(5)]
        assert means == pytest.approx([20, 60, 100, 140, 180], abs=6)
        await camera.close()

    asyncio.run(play())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, messages.REPLAY_MISSING),
        ("folder", messages.REPLAY_EMPTY),
        ("notes.txt", messages.REPLAY_EMPTY),
        ("broken.png", messages.REPLAY_UNREADABLE),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path, content, message):
    source = tmp_path / "recording"
    if content:
        source.mkdir()
    if content in {"notes.txt", "broken.png"}:
        (source / content).write_text("no image", encoding="utf-8")

    async def play():
        camera = ReplayCamera(settings(source))
        with pytest.raises(NoCameraError) as caught:
            await camera.open()
        assert caught.value.message.id == message.id
        with pytest.raises(CameraError) as early:
            await camera.frame(0.0, 0.1)
        assert early.value.message == messages.REPLAY_NOT_OPEN()
        await camera.close()

    asyncio.run(play())


@pytest.mark.parametrize("left", [12, 1])
def test_a_short_recording_is_no_faulty_camera(recording, left):
    for path in sorted(recording.glob("*.png"))[left:]:
        path.unlink()
    [finding] = asyncio.run(probe_camera(settings(recording, frames_per_s=None)))
    assert (finding.verdict, finding.remedy) == ("ok", None)
    assert (finding.found.parameters["width_px"], finding.found.parameters["height_px"]) == (48, 64)
