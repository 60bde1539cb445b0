"""Camera check of `station devices check`."""

import math
import time
from itertools import pairwise
from statistics import mean

from station.devices.camera.interface import Camera, CameraError, Frame, FrameFault, NoFrameError, describe
from station.devices.camera.open import camera_from
from station.devices.check_result import CheckResult
from station.messages import camera as messages
from station.messages.message import Message
from station.settings.camera import CameraSettings

_FRAMES = 15
_FRAME_DEADLINE_S = 1.0
_SLOW_SHARE = 0.8
_SHORTEST_S = 1e-3
"""Rate of a recording that is played as fast as requested."""

REMEDIES: dict[FrameFault, Message] = {
    FrameFault.STALE: messages.REMEDY_STALE(),
    FrameFault.REPEATED: messages.REMEDY_REPEATED(),
    FrameFault.TORN: messages.REMEDY_BROKEN(),
    FrameFault.SHIFTED: messages.REMEDY_BROKEN(),
    FrameFault.BLACK: messages.REMEDY_BLACK(),
    FrameFault.SATURATED: messages.REMEDY_SATURATED(),
    FrameFault.WRONG_SIZE: messages.REMEDY_WRONG_SIZE(),
}


async def probe_camera(settings: CameraSettings) -> list[CheckResult]:
    """Open the camera, check half a second of frames, and close it again. Never raises for a bad camera."""
    camera = camera_from(settings)
    try:
        await camera.open()
        return [_judged(camera, await _some_frames(camera, recorded=settings.driver == "replay"))]
    except CameraError as error:
        return [CheckResult("camera", messages.CHECK_NONE(driver=settings.driver), "fault", error.message)]
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
    intervals_s = sorted(after.captured_s - before.captured_s for before, after in pairwise(frames))
    # Without the longest: one pause of a busy machine says nothing of the camera, frames that are lost repeatedly do.
    usual_s = intervals_s[:-1] or intervals_s
    rate = 1 / max(_SHORTEST_S, mean(usual_s)) if usual_s else 0.0
    faults = sorted(frozenset().union(*(frame.faults for frame in frames)))
    seen = {"camera": description.name, "width_px": description.width_px, "height_px": description.height_px}
    found = (
        messages.CHECK_REVISION(**seen, rate=rate, revision=description.revision)
        if description.revision
        else messages.CHECK_FOUND(**seen, rate=rate)
    )
    if faults:
        bad = sum(1 for frame in frames if frame.faults)
        sick = messages.CHECK_BAD(found=found, number=len(frames), bad=bad, faults=describe(faults))
        remedies = list(dict.fromkeys(REMEDIES[fault] for fault in faults))
        return CheckResult("camera", sick, "fault", messages.REMEDIES(remedies=remedies))
    if description.notice:
        return CheckResult("camera", found, "warning", description.notice)
    if description.frames_per_s and len(frames) > 1 and rate < _SLOW_SHARE * description.frames_per_s:
        remedy = messages.REMEDY_SLOW(rate=description.frames_per_s)
        return CheckResult("camera", found, "warning", remedy)
    return CheckResult("camera", found, "ok")
