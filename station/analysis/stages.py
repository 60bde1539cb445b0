"""Stage pictures of a press: a method that stores them while a press tracker measures with it."""

import numpy as np
import numpy.typing as npt

from station.vision.contact import Contact, Image, Method, StageSink


class StagedMethod:
    """Measurement method that stores the stage pictures of the last image. Not safe for several threads at once."""

    def __init__(self, method: Method) -> None:
        self.stages, self._method = method.stages, method
        self.pictures: dict[str, npt.NDArray[np.uint8]] = {}
        """Of the image that was measured last, by the stages' names, in their order."""

    def measure(
        self,
        image: Image,
        on_stage: StageSink | None = None,
        previous: Contact | None = None,
        agreed: float = 1.0,
        *,
        firm_only: bool = False,
    ) -> Contact:
        """See `Method.measure`; `on_stage` is ignored: the pictures are in `pictures`."""
        self.pictures = {}

        def keep(name: str, picture: npt.NDArray[np.uint8]) -> None:
            self.pictures[name] = picture

        return self._method.measure(image, keep, previous, agreed, firm_only=firm_only)
