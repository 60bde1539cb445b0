"""Pictures for the pages: stored images, and the measurement's stages on them."""

import os
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from station.calibration.gate import gated
from station.messages import records as messages
from station.messages.message import message_of
from station.records.database import reading
from station.records.errors import RecordsError
from station.records.images import image_path
from station.records.model import FullRecord, StoredImage
from station.records.queries import read_inspection
from station.settings.problems import SettingsError
from station.settings.recipe_versions import parse_recipe
from station.vision.contact import Image
from station.vision.methods import make_method
from station.vision.press import PressTracker

LARGEST_IMAGE_BYTES = 8 * 1024 * 1024
_JPEG_QUALITY = 88


class Stages(NamedTuple):
    """The stages of a measurement, measured again from the stored image."""

    pictures: tuple[tuple[str, bytes], ...]
    """Names and JPEG files, in order."""
    area_px: int
    """As measured again."""


def read_image(folder: Path, sha256: str) -> bytes:
    """Read one stored image from the records' folder, by its content hash.

    Raises:
        RecordsError: it is not stored any more.
    """
    return _file(image_path(folder, sha256))


def read_stages(folder: Path, sequence: int, step: int) -> Stages:
    """Measure one step of an inspection again, by its own recipe.

    Raises:
        RecordsError: there is no such inspection, or its recipe or images are not stored any more.
    """
    with reading(folder) as connection:
        record = read_inspection(connection, sequence, folder)
    if record.trigger.recipe is None:
        raise RecordsError(messages.NO_RECIPE(number=sequence), messages.OPEN_ANOTHER())
    try:
        recipe = parse_recipe(record.trigger.recipe.text, f"inspection@{sequence}")
    except SettingsError as error:
        raise RecordsError(messages.UNKNOWN_RECIPE(), message_of(error)) from error
    reference = _picture(_stored(record, "reference", None))
    image = _picture(_stored(record, "step", step))
    if reference.shape != image.shape:
        raise RecordsError(messages.IMAGES_DIFFER(), messages.OPEN_ANOTHER_STEP())
    pictures: list[tuple[str, bytes]] = []

    def take(name: str, picture: np.ndarray) -> None:
        pictures.append((name, _jpeg(picture)))

    segmentation = gated(recipe.segmentation, _gate_factor(record))
    method = make_method(reference, segmentation)
    # A step is measured with the contact of the step before, and that one with its own: all of them again.
    tracker, previous = PressTracker(method), None
    for before in range(step):
        previous = tracker.measure_step([_picture(_stored(record, "step", before))])
    contact = method.measure(image, take, previous)
    return Stages(tuple(pictures), contact.area_px)


def _gate_factor(record: FullRecord) -> float:
    """Return the factor by which the sensor's calibration raised the detection threshold; 1 for none."""
    factor = record.judged.measures.get("gate_factor") if record.judged is not None else None
    return float(factor or 1.0)


def _stored(record: FullRecord, kind: str, step: int | None) -> StoredImage:
    for image in record.images:
        if image.kind == kind and image.step == step:
            return image
    number, state = record.sequence, record.images_state
    if step is None:
        raise RecordsError(messages.REFERENCE_NOT_KEPT(number=number, state=state), messages.WHAT_IS_KEPT())
    raise RecordsError(messages.STEP_NOT_KEPT(step=step, number=number, state=state), messages.WHAT_IS_KEPT())


def _file(path: str) -> bytes:
    try:
        if os.stat(path).st_size > LARGEST_IMAGE_BYTES:
            raise RecordsError(messages.IMAGE_TOO_LARGE(), messages.LOOK_AT_FILE(path=path))
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise RecordsError(messages.IMAGE_GONE(), messages.OLDEST_GO_FIRST()) from error


def _picture(image: StoredImage) -> Image:
    picture = cv2.imdecode(np.frombuffer(_file(image.path), np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise RecordsError(messages.IMAGE_DAMAGED(), messages.RUN_CHECK())
    return np.asarray(picture, np.uint8)


def _jpeg(picture: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()
