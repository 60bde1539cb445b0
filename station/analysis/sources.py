"""Image sources: the user's files, folders and videos as an ordered list of images, decoded when needed."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from natsort import natsorted, ns

from station.analysis.decoding import SUFFIXES, Decoded, decode_file, printable_name
from station.errors import BadInputError
from station.vision.median import median_image
from station.vision.working import working_image

VIDEO_SUFFIXES = frozenset({".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v", ".mpg", ".mpeg"})
_MOST_REFERENCE_FRAMES = 32
_LONGEST_STEM_BYTES = 200


@dataclass(frozen=True, slots=True)
class Source:
    """One image, decoded on demand."""

    name: str
    """The file's name, or the video's name with the frame's number."""
    stem: str
    """Name of its mask and stages."""
    load: Callable[[], Decoded]
    """Decodes it; raises BadInputError."""
    refused: bool = False
    """Known not to be loadable."""
    place: int = -1
    """Index of its folder or video among those named; -1 for a file that was named by itself."""
    from_video: bool = False


@dataclass(frozen=True, slots=True)
class Listing:
    """The sources found, and the other files of the folders, which are skipped."""

    sources: tuple[Source, ...]
    passed_over: tuple[Path, ...]


def list_sources(places: Sequence[Path], reference: Path | None = None) -> Listing:
    """Find the images of the places: files in the given order, a folder's files in natural order.

    A folder's files without an image's suffix, and the reference itself, are skipped.

    Args:
        places: image files, folders or videos.
        reference: a file that is not measured, also inside one of the folders.

    Returns:
        A place that has no images, or cannot be listed, is a source that fails when it is loaded.

    Raises:
        BadInputError: there is no place with an image, or two images would get the same mask.
    """
    found: list[Source] = []
    passed_over: list[Path] = []
    refused: list[BadInputError] = []
    for number, place in enumerate(places):
        try:
            listing = _list_place(place, reference)
        except BadInputError as error:
            refused.append(error)
            found.append(_refused_source(place, error))
        else:
            named_alone = len(listing.sources) == 1 and not place.is_dir() and not listing.sources[0].from_video
            found += [replace(source, place=-1 if named_alone else number) for source in listing.sources]
            passed_over += listing.passed_over
    if len(refused) == len(found):
        raise BadInputError("; ".join(str(error) for error in refused) or "no images were named")
    _refuse_equal_stems(found)
    return Listing(tuple(found), tuple(passed_over))


def load_references(place: Path) -> list[Decoded]:
    """Load the untouched gel: one image, or the images of a folder or video, of which the first 32 are used.

    Raises:
        BadInputError: one of them cannot be read, they differ in size, or they are black.
    """
    loaded = [source.load() for source in list_sources([place]).sources[:_MOST_REFERENCE_FRAMES]]
    if len({decoded.image.shape for decoded in loaded}) > 1:
        raise BadInputError(f"{place}: the reference images differ in size; take them from one sensor and mode")
    if not working_image(median_image([decoded.image for decoded in loaded])).any():
        raise BadInputError(
            f"{printable_name(place)}: the reference is black, so no change of its light can be measured; take it with "
            "the sensor's light on"
        )
    return loaded


def _list_place(place: Path, reference: Path | None) -> Listing:
    try:
        return _found_at(place, reference)
    except OSError as error:  # a name too long, or a folder above it that may not be searched
        raise BadInputError(f"{printable_name(place)}: cannot be read: {error.strerror}") from error


def _found_at(place: Path, reference: Path | None) -> Listing:
    if place.is_dir():
        files = natsorted((path for path in place.iterdir() if path.is_file()), alg=ns.PATH)
        chosen = [path for path in files if path.suffix.lower() in SUFFIXES and not _same(path, reference)]
        if not chosen:
            raise BadInputError(
                f"{printable_name(place)}: the folder has no images; expected {', '.join(sorted(SUFFIXES))}"
            )
        passed_over = tuple(path for path in files if path not in chosen)
        return Listing(tuple(_file_source(path) for path in chosen), passed_over)
    if place.suffix.lower() in VIDEO_SUFFIXES:
        return Listing(tuple(_video_sources(place)), ())
    if not place.exists():
        raise BadInputError(f"{printable_name(place)}: there is no such file")
    return Listing((_file_source(place),), ())


def _same(path: Path, other: Path | None) -> bool:
    return other is not None and path.samefile(other)


def _file_source(path: Path) -> Source:
    stem = printable_name(path.stem)
    if len(stem.encode()) > _LONGEST_STEM_BYTES:
        return _refused_source(
            path, BadInputError(f"{printable_name(path)}: the name is too long for its mask's; rename it")
        )
    return Source(printable_name(path.name), stem, lambda: decode_file(path))


def _refused_source(place: Path, error: BadInputError) -> Source:
    def load() -> Decoded:
        raise error

    return Source(printable_name(place.name), printable_name(place), load, refused=True)


def _video_sources(path: Path) -> Iterator[Source]:
    """List a video's frames; they are decoded in order, because seeking in a compressed video is not exact."""
    if not path.is_file():
        raise BadInputError(f"{printable_name(path)}: there is no such file")
    frames = _Video(path)
    if frames.announced > frames.count:
        whole = f"{frames.count} of {frames.announced} frames could be decoded; it is cut short or damaged"
        yield _refused_source(path, BadInputError(f"{printable_name(path)}: {whole}"))
    for index in range(frames.count):
        name = f"{printable_name(path.stem)}_{index:05d}"
        yield Source(name, name, lambda index=index: frames.frame(index), from_video=True)


class _Video:
    """Video read forwards, one frame at a time."""

    def __init__(self, path: Path) -> None:
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what FFmpeg says of a bad file names no remedy
        self._path = path
        self._capture = cv2.VideoCapture(str(path))
        self.announced = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        """Frame count in the header; an estimate in some formats, 0 in a broken file."""
        self.count = self._count()
        self._next = 0

    def _count(self) -> int:
        """Count the frames by decoding."""
        capture = cv2.VideoCapture(str(self._path))
        count = 0
        while capture.grab():
            count += 1
        capture.release()
        if count == 0:
            raise BadInputError(
                f"{printable_name(self._path)}: no frame of this video can be decoded; export it as MP4 or AVI"
            )
        return count

    def frame(self, index: int) -> Decoded:
        """Decode the frame with this index, which must be the next or a later one."""
        while self._next < index and self._capture.grab():
            self._next += 1
        good, image = self._capture.read()
        if not good:
            raise BadInputError(f"{printable_name(self._path)}: frame {index} cannot be decoded")
        self._next += 1
        if self._next == self.count:
            self._capture.release()
        return Decoded(np.asarray(image, np.uint8), ())


def _refuse_equal_stems(sources: Iterable[Source]) -> None:
    """Refuse two images of one stem: they would write one mask."""
    seen: dict[str, str] = {}
    for source in sources:
        if source.stem in seen:
            raise BadInputError(
                f"{source.name} and {seen[source.stem]} would both write masks/{source.stem}.png; "
                "measure them in two runs, or rename one"
            )
        seen[source.stem] = source.name
