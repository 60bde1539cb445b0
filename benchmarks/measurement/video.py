"""Video of the twin's frames: written by a codec, and decoded again."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from station.twin.digit.codec import Image

Codec = Literal["mp4v", "MJPG"]

_FILES: dict[Codec, tuple[str, int]] = {
    "mp4v": ("frames.mp4", cv2.CAP_FFMPEG),
    "MJPG": ("frames.avi", cv2.CAP_OPENCV_MJPEG),
}
"""Name of the file, and OpenCV's writer: only its own one for MJPG takes a quality."""
_FRAMES_PER_S = 30.0


def with_video(images: Sequence[Image], codec: Codec = "mp4v", quality: int | None = None) -> list[Image]:
    """The images after a video file: blocks, and with `mp4v` differences from frame to frame.

    Args:
        images: in order, all of one size; put the references first, so that they are coded with the press.
        codec: `mp4v` is MPEG-4 part 2 at the encoder's own bit rate, about 5 kB a frame; `MJPG` is a JPEG for each.
        quality: 0 to 100, used by `MJPG` only; the encoder's own where left out.

    Raises:
        OSError: OpenCV has no such codec here, or the file has not as many frames as were written.
    """
    if not images:
        return []
    height, width = images[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        name, writers = _FILES[codec]
        path = str(Path(folder) / name)
        writer = cv2.VideoWriter(path, writers, cv2.VideoWriter.fourcc(*codec), _FRAMES_PER_S, (width, height))
        if not writer.isOpened():
            raise OSError(f"OpenCV cannot write {codec} video here")
        if quality is not None:
            writer.set(cv2.VIDEOWRITER_PROP_QUALITY, float(quality))
        for image in images:
            writer.write(image)
        writer.release()
        reader = cv2.VideoCapture(path)
        decoded: list[Image] = []
        while (found := reader.read())[0]:
            decoded.append(np.asarray(found[1], np.uint8))
        reader.release()
    if len(decoded) != len(images):
        raise OSError(f"{codec}: {len(images)} frames written, {len(decoded)} read")
    return decoded
