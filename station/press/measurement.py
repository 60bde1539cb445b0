"""Press measurement: the contact of each step, by itself while the onset is searched, then as a step of one press."""

from station.inspection.press import Measured
from station.press.rig import MeasuredStep, Step
from station.vision.contact import Contact, Image, Method
from station.vision.press import PressTracker
from station.vision.step import measure_step


class PressMeasurement:
    """Measurement of one press by a method prepared for its reference. Not safe for use from several threads at once.

    The jaws may open again while the onset is searched, so each step is measured by itself then. From `follow` on the
    compression only rises: each step is measured with the contact of the step before.
    """

    def __init__(self, method: Method) -> None:
        self._method = method
        self._tracker: PressTracker | None = None
        """Of the press that is followed; None while each step is measured by itself."""
        self._known: dict[int, tuple[Image, Contact]] = {}
        """Frames that are measured already, each by itself, by their `id`."""

    def begin(self) -> None:
        """Measure each step by itself, against the same reference, after the jaws were opened."""
        self._tracker = None
        self._known.clear()

    def follow(self, first: Contact) -> None:
        """Measure every later step as a step of one press, of which this is the first contact."""
        self._tracker = PressTracker(self._method, first)
        self._known.clear()

    def prepare_next(self, image: Image) -> None:
        """Measure one frame of the next step, the same object, while more come, so that `measure` has less to do."""
        if self._tracker is not None:
            self._tracker.prepare_next(image)
        else:
            # With the image itself: while it is referenced no other one gets its `id`.
            self._known[id(image)] = image, self._method.measure(image, firm_only=True)

    def seek(self, step: Step) -> MeasuredStep:
        """Measure a step of the approach, where only a firm contact counts."""
        if self._tracker is not None or len(step.images) > 1:
            return self.measure(step)
        [image] = step.images
        known = self._known.get(id(image))
        contact = self._method.measure(image, firm_only=True) if known is None else known[1]
        # The frame that shows the contact first is one of those that confirm it.
        self._known = {key: (one, found) for key, (one, found) in self._known.items() if found.is_firm}
        if contact.is_firm:
            self._known[id(image)] = image, contact
        return MeasuredStep(step, image, contact)

    def measure(self, step: Step) -> MeasuredStep:
        """Find the contact in a step's frames, of the reference's shape."""
        image = step.image
        if self._tracker is not None:
            return MeasuredStep(step, image, self._tracker.measure_step(step.images, image))
        # A weak contact was not searched for in the others.
        known = {key: contact for key, (_, contact) in self._known.items() if contact.is_firm}
        contact = measure_step(self._method, step.images, known=known, mean=image)
        self._known.clear()
        if len(step.images) == 1 and contact.is_firm:  # as in `seek`
            self._known[id(image)] = image, contact
        return MeasuredStep(step, image, contact)


def measured_point(contact: Contact, closing_mm: float, mm_per_px: float) -> Measured:
    """Return a contact, at its step's closing from the onset, as the judge takes it."""
    changed_px = contact.changed_area_px
    return Measured(
        closing_mm=closing_mm,
        area_mm2=contact.area_px * mm_per_px**2,
        area_px=contact.area_px,
        confidence=contact.confidence,
        flags=contact.flags,
        changed_area_mm2=None if changed_px is None else changed_px * mm_per_px**2,
        changed_area_px=changed_px,
    )
