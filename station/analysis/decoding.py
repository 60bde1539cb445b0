"""Image decoding: one checked image file in, one colour image out."""

import os
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
import PIL.Image

from station.errors import BadInputError
from station.vision.contact import Image

FORMATS = ("JPEG", "PNG", "BMP", "TIFF", "WEBP", "PPM")
SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"})
LARGEST_FILE_BYTES = 200_000_000
LARGEST_IMAGE_PX = 50_000_000
SMALLEST_SIDE_PX = 32
_PNG = b"\x89PNG\r\n\x1a\n"
_MODES = {"P": "palette", "PA": "palette", "CMYK": "CMYK", "LAB": "CIELAB"}


@dataclass(frozen=True, slots=True)
class Decoded:
    """Colour image, with the conversions that it needed."""

    image: Image
    conversions: tuple[str, ...]


def printable_name(name: Path | str) -> str:
    """Return a printable name: bytes that are no UTF-8 are escaped."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def decode_file(path: Path) -> Decoded:
    """Read an image file (JPEG, PNG, BMP, TIFF, WebP or PPM) as stored, without rotation by its EXIF data.

    Raises:
        BadInputError: the file cannot be read, is no such image, is cut short, or is absurdly large or small.
    """
    try:
        size_bytes = path.stat().st_size
        if not path.is_file():
            raise BadInputError(f"{printable_name(path)}: expected an image file, found something else")
        if size_bytes > LARGEST_FILE_BYTES:
            raise BadInputError(
                f"{printable_name(path)}: expected an image of at most {LARGEST_FILE_BYTES} bytes, found {size_bytes}"
            )
        data = path.read_bytes()
    except OSError as error:
        raise BadInputError(f"{printable_name(path)}: cannot be read: {error.strerror}") from error
    conversions = _checked(path, data)
    try:
        raw = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        raw = None
    if raw is None:
        raise BadInputError(f"{printable_name(path)}: cannot be decoded; export it again as PNG or JPEG")
    decoded = to_colour(path, np.asarray(raw))
    return Decoded(decoded.image, (*conversions, *decoded.conversions))


def _checked(path: Path, data: bytes) -> list[str]:
    """Refuse a file that is no image, of absurd size or truncated; report conversions that OpenCV does silently.

    OpenCV alone fills the missing part of a truncated JPEG with grey, without an error.
    """
    if not data:
        raise BadInputError(f"{printable_name(path)}: the file is empty; copy it again")
    try:
        with warnings.catch_warnings(action="ignore"), PIL.Image.open(BytesIO(data), formats=FORMATS) as picture:
            _check_size(path, *picture.size)
            # Decoded only for the error that a truncated file raises here.
            picture.load()
            conversions = [f"{_MODES[picture.mode]} turned into colour"] if picture.mode in _MODES else []
            if getattr(picture, "n_frames", 1) > 1:
                conversions.append("only the first page of several")
    except PIL.UnidentifiedImageError as error:
        raise BadInputError(f"{printable_name(path)}: not an image; expected one of {', '.join(FORMATS)}") from error
    except PIL.Image.DecompressionBombError as error:
        raise BadInputError(f"{printable_name(path)}: more than {LARGEST_IMAGE_PX} pixels") from error
    except BadInputError:
        raise
    except Exception as error:  # Pillow raises any kind of error for a damaged file
        raise BadInputError(
            f"{printable_name(path)}: damaged or cut short ({error}); copy it again from the source"
        ) from error
    if data.startswith(_PNG):
        _check_chunks(path, data)
    return conversions


def _check_size(path: Path, width_px: int, height_px: int) -> None:
    if width_px * height_px > LARGEST_IMAGE_PX:
        raise BadInputError(f"{printable_name(path)}: {width_px}x{height_px} is more than {LARGEST_IMAGE_PX} pixels")
    if min(width_px, height_px) < SMALLEST_SIDE_PX:
        raise BadInputError(
            f"{printable_name(path)}: {width_px}x{height_px} is smaller than {SMALLEST_SIDE_PX} pixels a side"
        )


def _check_chunks(path: Path, data: bytes) -> None:
    """Refuse a PNG with a chunk longer than the file: OpenCV allocates up to 4 GB for it before it reads."""
    start, kind = len(_PNG), b""
    while kind != b"IEND":
        length, kind = int.from_bytes(data[start : start + 4]), data[start + 4 : start + 8]
        start += 12 + length
        if start > len(data):
            raise BadInputError(f"{printable_name(path)}: damaged or cut short; copy it again from the source")


def to_colour(path: Path, raw: np.ndarray) -> Decoded:
    """Convert an image, (height, width) or (height, width, 1 to 4), uint8 or uint16, to 8-bit BGR; say how.

    Raises:
        BadInputError: another dtype or number of channels.
    """
    conversions: list[str] = []
    if raw.dtype == np.uint16:
        # 65,535 is 257 times 255, so white stays white.
        raw = (raw // 257).astype(np.uint8)
        conversions.append("16 bits scaled to 8")
    if raw.dtype != np.uint8:
        raise BadInputError(
            f"{printable_name(path)}: expected 8 or 16 bits a channel, found {raw.dtype}; export it as PNG"
        )
    channels = 1 if raw.ndim == 2 else raw.shape[2]
    if channels in {2, 4}:
        raw = raw[:, :, : channels - 1]
        conversions.append("transparency dropped")
    if channels in {1, 2}:
        raw = np.repeat(raw.reshape(*raw.shape[:2], 1), 3, axis=2)
        conversions.append("grey spread to three channels")
    return Decoded(np.ascontiguousarray(raw, np.uint8), tuple(conversions))
