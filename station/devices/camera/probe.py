"""Camera check of `station devices check`."""

import math
import time

from station.devices.camera.interface import Camera, CameraError, Frame, FrameFault, NoFrameError
from station.devices.camera.open import camera_from
from station.devices.check_result import CheckResult
from station.settings.camera import CameraSettings

_FRAMES = 15
_FRAME_DEADLINE_S = 1.0
_SLOW_SHARE = 0.8
_SHORTEST_S = 1e-3
"""Rate of a recording that is played as fast as requested."""

REMEDIES = {
    FrameFault.STALE: "the computer or the link is too slow: close other programs, use a USB port of its own",
    FrameFault.REPEATED: "the sensor is frozen: unplug it and plug it in again",
    FrameFault.TORN: "the USB link drops data: change cable or port",
    FrameFault.SHIFTED: "the USB link drops data: change cable or port",
    FrameFault.BLACK: "no light: check the LED settings and the sensor's cable",
    FrameFault.SATURATED: "too much light: lower the LED settings, shade the gel",
    FrameFault.WRONG_SIZE: "another mode than asked for: close other programs that use the sensor",
}


async def probe_camera(settings: CameraSettings) -> list[CheckResult]:
    """Open the camera, check half a second of frames, and close it again. Never raises for a bad camera."""
    camera = camera_from(settings)
    try:
        await camera.open()
        return [_judged(camera, await _some_frames(camera, recorded=settings.driver == "replay"))]
    except CameraError as error:
        return [CheckResult("camera", f"driver {settings.driver}: no usable camera", "fault", str(error))]
    finally:
        await camera.close()


async def _some_frames(camera: Camera, *, recorded: bool) -> list[Frame]:
    """Read so many frames, or as many as a recording has."""
    frames: list[Frame] = []
    newest_s = -math.inf if recorded else time.monotonic()
    try:
        while len(frames) < _FRAMES:
            frames.append(await camera.frame(newest_s, _FRAME_DEADLINE_S))
            newest_s = frames[-1].captured_s
    except NoFrameError:
        if not (recorded and frames):
            raise
    return frames


def _judged(camera: Camera, frames: list[Frame]) -> CheckResult:
    description = camera.description
    rate = (len(frames) - 1) / max(_SHORTEST_S, frames[-1].captured_s - frames[0].captured_s)
    faults = sorted(frozenset().union(*(frame.faults for frame in frames)))
    name = f"{description.name}, revision {description.revision}" if description.revision else description.name
    found = f"{name}, {description.width_px}x{description.height_px}, {rate:.1f} frames/s"
    if faults:
        sick = sum(1 for frame in frames if frame.faults)
        remedy = "; ".join(REMEDIES[fault] for fault in faults)
        return CheckResult("camera", f"{found}, {sick} of {len(frames)} frames {', '.join(faults)}", "fault", remedy)
    if description.notice:
        return CheckResult("camera", found, "warning", description.notice)
    if description.frames_per_s and len(frames) > 1 and rate < _SLOW_SHARE * description.frames_per_s:
        remedy = f"{description.frames_per_s:g} frames/s were expected: close other programs, use a USB port of its own"
        return CheckResult("camera", found, "warning", remedy)
    return CheckResult("camera", found, "ok", "")
