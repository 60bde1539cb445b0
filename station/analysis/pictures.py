"""Result pictures: the image with its contact's outline, and sheets of many images."""

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.contact import Image, Mask

_OUTLINE_BGR = (255, 255, 255)
_INK_BGR = (30, 30, 30)
_PAPER_GREY = 245
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_MARGIN_PX = 8
_LINE_PX = 16
_WIDEST_SHARE = 3


def outlined(image: Image, mask: Mask) -> Image:
    """Draw the mask's outline into the image, on a dark line so that it is visible on any background.

    Args:
        image: shape (height, width, 3), dtype uint8.
        mask: shape (height, width), dtype uint8.
    """
    drawn = image.copy()
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    thin = max(1, round(min(mask.shape) / 240))
    cv2.drawContours(drawn, contours, -1, (0, 0, 0), 3 * thin)
    cv2.drawContours(drawn, contours, -1, _OUTLINE_BGR, thin)
    return drawn


def thumbnail(picture: npt.NDArray[np.uint8], height_px: int) -> Image:
    """Shrink to a height, or less if the width would be more than three times the height, and convert grey to colour.

    Args:
        picture: shape (height, width) or (height, width, 3), dtype uint8.
    """
    scale = min(height_px / picture.shape[0], _WIDEST_SHARE * height_px / picture.shape[1])
    size = max(1, round(scale * picture.shape[1])), max(1, round(scale * picture.shape[0]))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_GRAY2BGR) if small.ndim == 2 else small, np.uint8)


def sheet(columns: Sequence[tuple[str, Sequence[Image]]], row_names: Sequence[str] = ()) -> Image:
    """Arrange columns of pictures, each with its caption below, with the rows' names at the left.

    Args:
        columns: caption (lines separated by a line feed) and the pictures from top to bottom, all of one size.
        row_names: one for each row, or none.
    """
    height_px, width_px = columns[0][1][0].shape[:2]
    left_px = 96 if row_names else _MARGIN_PX
    lines = max(caption.count("\n") + 1 for caption, _ in columns)
    rows = len(columns[0][1])
    canvas = np.full(
        (
            _MARGIN_PX + rows * (height_px + _MARGIN_PX) + lines * _LINE_PX,
            left_px + len(columns) * (width_px + _MARGIN_PX),
            3,
        ),
        _PAPER_GREY,
        np.uint8,
    )
    for number, (caption, pictures) in enumerate(columns):
        x = left_px + number * (width_px + _MARGIN_PX)
        for row, picture in enumerate(pictures):
            y = _MARGIN_PX + row * (height_px + _MARGIN_PX)
            canvas[y : y + height_px, x : x + width_px] = picture
        for line, text in enumerate(caption.split("\n")):
            y = rows * (height_px + _MARGIN_PX) + (line + 1) * _LINE_PX
            cv2.putText(canvas, _fitting(text, width_px), (x, y), _FONT, 0.38, _INK_BGR, 1, cv2.LINE_AA)
    for row, name in enumerate(row_names):
        y = _MARGIN_PX + row * (height_px + _MARGIN_PX) + height_px // 2
        cv2.putText(canvas, name, (_MARGIN_PX, y), _FONT, 0.42, _INK_BGR, 1, cv2.LINE_AA)
    return canvas


def stacked(sheets: Sequence[Image]) -> Image:
    """Stack sheets vertically; the narrower ones are padded at the right."""
    widest_px = max(picture.shape[1] for picture in sheets)
    return np.vstack(
        [
            np.pad(picture, ((0, 0), (0, widest_px - picture.shape[1]), (0, 0)), constant_values=_PAPER_GREY)
            for picture in sheets
        ]
    )


def _fitting(text: str, width_px: int) -> str:
    """Shorten a caption in its middle until it fits below its picture."""
    shown = text
    while len(shown) > 3 and cv2.getTextSize(shown, _FONT, 0.38, 1)[0][0] > width_px:
        keep = (len(shown) - 3) // 2
        shown = f"{shown[:keep]}..{shown[-keep:]}" if keep else shown[:3]
    return shown
