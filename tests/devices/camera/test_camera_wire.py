import asyncio
import contextlib
import json
import struct
import time

import cv2
import numpy as np
import pytest

from station.devices.camera.interface import CameraDescription, Frame, FrameFault, Leds, NoCameraError, NoFrameError
from station.devices.camera.probe import probe_camera
from station.devices.camera.twin import TwinCamera
from station.messages import camera as messages
from station.messages.message import Message
from station.twin.digit.sensor import DigitSensor
from station.twin.digit.server import GEL_FAULTS
from station.twin.faults import LARGEST_AMOUNT


async def fresh(camera, deadline_s=3.0):
    return await camera.frame(time.monotonic(), deadline_s)


async def refusal(settings, port: int) -> Message:
    """Return why a camera does not open, with a longer limit where a busy machine has tried nothing yet.

    Args:
        settings: fixture `twin_settings`.
    """
    for limit_s in (0.5, 4.0, 30.0):
        with pytest.raises(NoCameraError) as caught:
            await TwinCamera(settings(port, open_deadline_s=limit_s)).open()
        assert caught.value.message.id == messages.TWIN_NO_FIRST_FRAME.id
        assert caught.value.message.parameters["limit_s"] == limit_s
        reason = caught.value.message.parameters["reason"]
        assert isinstance(reason, Message)
        if reason != messages.NOTHING_SENT():
            return reason
    raise AssertionError("nothing was tried within half a minute")


async def until(camera, good, deadline_s=10.0):
    """The first frame that is as wanted."""
    async with asyncio.timeout(deadline_s):
        while not good(frame := await fresh(camera)):
            pass
    return frame


async def truth(server, **fields):
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    request = json.dumps({"kind": "truth", **fields}).encode()
    writer.write(struct.pack(">I", len(request)) + request)
    (length,) = struct.unpack(">I", await reader.readexactly(4))
    header = json.loads(await reader.readexactly(length))
    payload = await reader.readexactly(header["bytes"])
    writer.close()
    await writer.wait_closed()
    return header, payload


def test_frames_come_in_order_fresh_and_healthy(bench):
    async def play():
        async with bench() as one:
            await one.camera.open()
            await one.camera.open()
            requested_s = time.monotonic()
            frames = [await fresh(one.camera) for _ in range(5)]
            assert all(frame.captured_s > requested_s for frame in frames)
            assert [frame.sequence for frame in frames] == sorted({frame.sequence for frame in frames})
            assert len({frame.image.tobytes() for frame in frames}) == 5
            for frame in frames:
                assert frame.faults == frozenset()
                assert frame.image.shape == (640, 480, 3)
            description = one.camera.description
            assert (description.height_px, description.width_px, description.mm_per_px) == (640, 480, 0.0266)

    asyncio.run(play())


def test_a_press_shows_and_its_truth_is_told_to_tests(bench):
    async def play():
        async with bench() as one:
            await one.camera.open()
            untouched = (await fresh(one.camera)).image.astype(float)
            header, mask = await truth(one.server)
            assert header["force_n"] == 0
            assert not any(mask)
            one.close_to(3.0)
            touched = (await fresh(one.camera)).image.astype(float)
            header, mask = await truth(one.server)
            truth_mask = np.frombuffer(mask, np.uint8).reshape(header["height"], header["width"]) > 0
            assert header["closing_mm"] == pytest.approx(3.0)
            assert header["force_n"] > 1
            change = cv2.GaussianBlur(np.abs(touched - untouched).max(axis=2), (0, 0), 5)
            assert change[truth_mask].mean() > 2.5 * change[~truth_mask].mean()
            older, _ = await truth(one.server, sequence=1)
            assert older["sequence"] == 1

    asyncio.run(play())


@pytest.mark.parametrize(
    ("fault", "amount", "named"),
    [
        ("stuck", 1.0, FrameFault.REPEATED),
        ("wrong", 1.0, FrameFault.WRONG_SIZE),
        ("frame_torn", 1.0, FrameFault.TORN),
        ("frame_shifted", 1.0, FrameFault.SHIFTED),
        ("frame_black", 1.0, FrameFault.BLACK),
        ("frame_saturated", 1.0, FrameFault.SATURATED),
    ],
)
def test_a_fault_in_the_frames_is_named_and_passes_with_the_fault(bench, fault, amount, named):
    async def play():
        async with bench() as one:
            await one.camera.open()
            await fresh(one.camera)
            one.server.faults.set(fault, LARGEST_AMOUNT)
            await until(one.camera, lambda frame: named in frame.faults)
            one.server.faults.clear()
            await until(one.camera, lambda frame: not frame.faults)

    asyncio.run(play())


@pytest.mark.parametrize(("fault", "amount"), [("off", 1.0), ("garbage", 1.0), ("slow", 300.0)])
def test_without_frames_the_wait_ends_at_its_deadline_and_the_camera_comes_back(bench, fault, amount):
    async def play():
        async with bench() as one:
            await one.camera.open()
            one.server.faults.set(fault, LARGEST_AMOUNT)
            await asyncio.sleep(0.3)
            began_s = time.monotonic()
            with pytest.raises(NoFrameError) as caught:
                await fresh(one.camera, 0.5)
            assert time.monotonic() - began_s < 5
            message = caught.value.message
            assert message.id == messages.NO_FRAME.id
            assert message.parameters["camera"] == messages.TWIN(address=f"127.0.0.1:{one.server.port}")
            reasons = message.parameters["reasons"]
            assert isinstance(reasons, tuple)
            newest, *troubles = [reason.id for reason in reasons]
            assert newest == messages.NEWEST.id
            if fault == "garbage":
                assert troubles == [messages.LONG_HEADER.id]
            one.server.faults.clear()
            if fault != "slow":
                await until(one.camera, lambda frame: not frame.faults)

    asyncio.run(play())


@pytest.mark.parametrize("fault", ["dirt", "slow", "lens_fogged", "led_dead"])
def test_no_amount_keeps_the_camera_from_coming_back_once_it_is_cleared(bench, fault):
    async def play():
        async with bench() as one:
            await one.camera.open()
            one.server.faults.set(fault, LARGEST_AMOUNT)
            with contextlib.suppress(NoFrameError):
                await fresh(one.camera, 0.5)
            one.server.faults.clear()
            await until(one.camera, lambda frame: not frame.faults)

    asyncio.run(play())


def test_a_frame_that_cannot_be_drawn_is_logged_once_and_the_next_one_comes(bench, monkeypatch, caplog):
    async def play():
        async with bench() as one:
            await one.camera.open()
            with monkeypatch.context() as broken:
                broken.setattr(DigitSensor, "frame", lambda *_: 1 / 0)
                with pytest.raises(NoFrameError):
                    await fresh(one.camera, 0.3)
            await until(one.camera, lambda frame: not frame.faults)

    asyncio.run(play())
    [record] = [record for record in caplog.records if record.name == "station.twin.digit.server"]
    assert "could not draw" in record.message


def test_a_delayed_frame_is_not_fresh(bench):
    async def play():
        async with bench() as one:
            await one.camera.open()
            one.server.faults.set("delayed", 0.8)
            await until(one.camera, lambda frame: FrameFault.STALE in frame.faults)
            requested_s = time.monotonic()
            frame = await one.camera.frame(requested_s, 5.0)
            assert time.monotonic() - requested_s >= 0.8
            assert frame.captured_s > requested_s

    asyncio.run(play())


def test_an_intermittent_camera_is_found_again_each_time(bench):
    async def play():
        async with bench() as one:
            await one.camera.open()
            one.server.faults.set("intermittent", 0.3)
            frames = [await fresh(one.camera) for _ in range(20)]
            assert [frame.sequence for frame in frames] == sorted({frame.sequence for frame in frames})

    asyncio.run(play())


def test_a_worn_gel_shows_a_press_more_weakly(bench):
    async def play():
        async with bench() as one:
            await one.camera.open()
            untouched = (await fresh(one.camera)).image.astype(float)
            one.close_to(3.0)
            await fresh(one.camera)  # which may have been drawn before the jaws closed, on a busy machine
            sound = np.abs((await fresh(one.camera)).image - untouched).sum()
            one.server.faults.set("gel_worn")
            await until(one.camera, lambda frame: np.abs(frame.image - untouched).sum() < 0.8 * sound)

    asyncio.run(play())


@pytest.mark.parametrize("fault", [fault for fault in GEL_FAULTS if fault != "gel_worn"])
def test_an_ill_gel_lens_or_led_shows(bench, fault):
    async def play():
        async with bench() as one:
            await one.camera.open()
            sound = (await fresh(one.camera)).image.astype(float)
            one.server.faults.set(fault)
            await until(one.camera, lambda frame: np.abs(frame.image - sound).max() > 50)

    asyncio.run(play())


def test_the_light_is_set_and_a_bad_light_refused(bench):
    async def play():
        async with bench() as one:
            await one.camera.open()
            before = (await fresh(one.camera)).image.mean(axis=(0, 1))
            await one.camera.set_leds(Leds(15, 3, 15))
            after = await until(one.camera, lambda frame: frame.image[..., 1].mean() < 0.5 * before[1])
            assert after.image[..., 2].mean() == pytest.approx(before[2], rel=0.15)
            with pytest.raises(Exception, match="expected a whole number from 0 to 15"):
                await one.camera.set_leds(Leds(16, 0, 0))

    asyncio.run(play())


def test_nobody_there_is_said_with_a_remedy(twin_settings):
    assert asyncio.run(refusal(twin_settings, 1)).id == messages.LINK_FAILED.id


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (b"{", messages.UNREADABLE_HEADER),
        (b"[" * 4000, messages.UNREADABLE_HEADER),
        (b"[1]", messages.WRONG_HEADER),
        (
            b'{"kind": "frame", "height": 640, "width": 480, "sequence": 1, "age_s": 1' + b"0" * 400 + b"}",
            messages.WRONG_AGE,
        ),
        (b'{"kind": "cake"}', messages.NO_FRAME_HEADER),
        (b'{"kind": "frame", "height": 640, "width": 480, "sequence": 1, "age_s": -1}', messages.WRONG_AGE),
        (b'{"kind": "frame", "height": 640, "width": true, "sequence": 1, "age_s": 0}', messages.NOT_WHOLE),
        (b'{"kind": "frame", "height": 640, "width": 99999, "sequence": 1, "age_s": 0}', messages.WRONG_SIZE),
        (b'{"kind": "frame", "height": 2, "width": 2, "sequence": 1, "age_s": 0, "bytes": 11}', messages.WRONG_LENGTH),
    ],
)
def test_a_peer_gone_mad_is_described(twin_settings, header, message):
    async def answer(reader, writer):
        with contextlib.closing(writer):
            writer.write(struct.pack(">I", len(header)) + header)
            await writer.drain()

    async def play():
        server = await asyncio.start_server(answer, "127.0.0.1", 0)
        async with server:
            assert (await refusal(twin_settings, server.sockets[0].getsockname()[1])).id == message.id

    asyncio.run(play())


def test_a_frame_that_is_older_than_the_one_before_it_is_never_given(twin_settings):
    def message(sequence):
        header = {"kind": "frame", "height": 2, "width": 2, "sequence": sequence, "age_s": 0, "bytes": 12}
        text = json.dumps(header).encode()
        return struct.pack(">I", len(text)) + text + bytes(12)

    async def answer(reader, writer):
        with contextlib.closing(writer):  # also where the loop ends before the camera's end has come
            writer.write(message(5) + message(4))
            await reader.read()

    async def play():
        server = await asyncio.start_server(answer, "127.0.0.1", 0)
        async with server:
            camera = TwinCamera(twin_settings(server.sockets[0].getsockname()[1]))
            await camera.open()
            for _ in range(3):
                assert (await camera.frame(time.monotonic(), 20.0)).sequence == 5
            await camera.close()

    asyncio.run(play())


def test_a_bad_request_is_refused_with_words(bench):
    async def play():
        async with bench() as one:
            refused, _ = await truth(one.server, sequence=12345)
            assert "12345 is not among the last" in refused["message"]
            reader, writer = await asyncio.open_connection("127.0.0.1", one.server.port)
            writer.write(struct.pack(">I", 2**31))
            (length,) = struct.unpack(">I", await reader.readexactly(4))
            assert "at most" in json.loads(await reader.readexactly(length))["message"]
            writer.close()
            await writer.wait_closed()

    asyncio.run(play())


def test_a_request_nested_too_deep_is_refused_and_the_camera_goes_on(bench):
    async def play():
        async with bench() as one:
            reader, writer = await asyncio.open_connection("127.0.0.1", one.server.port)
            writer.write(struct.pack(">I", 4000) + b"[" * 4000)
            (length,) = struct.unpack(">I", await reader.readexactly(4))
            assert "nested too deep" in json.loads(await reader.readexactly(length))["message"]
            writer.close()
            await writer.wait_closed()
            await one.camera.open()

    asyncio.run(play())


@pytest.mark.parametrize(
    ("hold_s", "message"), [(0.0, messages.LINK_CLOSED()), (30.0, messages.LINK_SILENT(limit_s=0.2))]
)
def test_a_peer_that_hangs_up_or_says_nothing_is_told_in_words(twin_settings, monkeypatch, hold_s, message):
    monkeypatch.setattr("station.devices.camera.twin._SILENCE_S", 0.2)

    async def answer(reader, writer):
        with contextlib.closing(writer), contextlib.suppress(TimeoutError):
            async with asyncio.timeout(hold_s):
                await reader.read()

    async def play():
        server = await asyncio.start_server(answer, "127.0.0.1", 0)
        async with server:
            assert await refusal(twin_settings, server.sockets[0].getsockname()[1]) == message

    asyncio.run(play())


@pytest.mark.parametrize(
    ("rate", "verdict", "remedy"), [(30.0, "ok", None), (20.0, "warning", messages.REMEDY_SLOW(rate=30.0))]
)
def test_the_probe_counts_the_time_between_frames(monkeypatch, twin_settings, rate, verdict, remedy):
    class Steady:
        description = CameraDescription("steady", 480, 640, 0.03, 30.0)
        frames = iter([Frame(np.zeros((1, 1, 3), np.uint8), number, number / rate) for number in range(1, 99)])

        async def open(self): ...

        async def close(self): ...

        async def frame(self, *_):
            return next(self.frames)

    monkeypatch.setattr("station.devices.camera.probe.camera_from", lambda _: Steady())
    [finding] = asyncio.run(probe_camera(twin_settings(1)))
    assert finding.found.parameters["rate"] == pytest.approx(rate)
    assert (finding.device, finding.verdict, finding.remedy) == ("camera", verdict, remedy)


def test_the_probe_tells_a_good_camera_a_sick_one_and_none(bench, twin_settings):
    async def play():
        async with bench() as one:
            settings = twin_settings(one.server.port)
            [good] = await probe_camera(settings)
            # A busy machine delivers fewer frames than were promised, and the probe reports it.
            assert good.verdict == "ok" or good.remedy == messages.REMEDY_SLOW(rate=30.0)
            assert (good.found.parameters["width_px"], good.found.parameters["height_px"]) == (480, 640)
            one.server.faults.set("frame_black")
            [sick] = await probe_camera(settings)
            assert sick.verdict == "fault"
            assert sick.found.parameters["faults"] == (messages.FRAME_BLACK(),)
            assert sick.remedy == messages.REMEDIES(remedies=[messages.REMEDY_BLACK()])
        [gone] = await probe_camera(twin_settings(1, open_deadline_s=0.3))
        assert gone.verdict == "fault"
        assert gone.remedy is not None
        assert gone.remedy.id == messages.TWIN_NO_FIRST_FRAME.id

    asyncio.run(play())
