"""Press tracker: measures the steps of one press in order and follows the contact from step to step."""

from collections.abc import Sequence

from station.vision.contact import Contact, Image, Method
from station.vision.step import measure_step


class PressTracker:
    """The measurement of one press whose compression only rises.

    Not safe for use from several threads at once.

    Args:
        method: prepared for the press's reference.
        first: the contact at the press's first step where that is measured already, for example by an approach.
    """

    def __init__(self, method: Method, first: Contact | None = None) -> None:
        self._method, self._previous = method, first
        self._ahead: dict[int, tuple[Image, Contact]] = {}

    def prepare_next(self, image: Image) -> None:
        """Measure one frame of the next step, the same object that `measure_step` gets, which then has less to do."""
        # The image is stored too: while it lives, no other object has its id.
        self._ahead[id(image)] = image, self._method.measure(image, previous=self._previous)

    def measure_step(self, frames: Sequence[Image], mean: Image | None = None) -> Contact:
        """Measure the frames of the next step, and follow its contact from now on.

        Args:
            frames: one or more of the reference's shape, dtype uint8, in which nothing has moved.
            mean: their mean where it is there already.

        Raises:
            ValueError: there is no frame, or they are not of the reference's shape and of one dtype.
        """
        known = {key: contact for key, (_, contact) in self._ahead.items()}
        self._ahead.clear()
        contact = measure_step(self._method, frames, self._previous, known, mean)
        self._previous = contact
        return contact
