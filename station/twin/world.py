"""Physical state between the fingers: one fruit in one pose, its closing, and what that has done to it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from station.twin.clock import Clock
from station.twin.contact import Footprint, FruitOnGel, Pose
from station.twin.fruit import Fruit
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze, Squeezed

DIGIT_MM = 32.0
"""What the sensor takes of the gripper's opening."""
# A fruit creeps over seconds (retardation times of 5 s and more): its curve need not be new at every read.
_CREEP_STEP_S = 0.5
_SOFTENING_MAX = 0.5
_SET_SHARE = 0.25
_PLACE_DIGITS = 2
"""Of the sensor's place in mm: the joints' rounding is no motion."""


@dataclass(frozen=True, slots=True)
class Touch:
    """One moment of a squeeze, small enough to be handed to another thread that draws it."""

    contact: FruitOnGel
    squeezed: Squeezed


class World:
    """One fruit at most, between the DIGIT's gel and the sponge on the other finger.

    Squeezed beyond its yield force and let go, a fruit stays narrower and softer: by a quarter of the closing
    beyond the yield, and by up to half of its modulus.
    """

    def __init__(self, clock: Clock, gel: Gel | None = None) -> None:
        self._clock = clock
        self._gel = gel or Gel()
        self._holder_mm = 0.0
        self._opening_mm = 85.0
        self._pose = Pose()
        self._fruit: Fruit | None = None
        self._contact: tuple[tuple[float, float], FruitOnGel] | None = None
        """With the sensor's place that it was made for."""
        self._squeeze: Squeeze | None = None
        self._crept_s = 0.0
        self._since_s: float | None = None
        self._worst: Squeezed | None = None
        self.sensor_mm: Callable[[], tuple[float, float] | None] = lambda: (0.0, 0.0)
        """How far the sensor is from where the fruit was laid against it, to the right and down in its image; None
        where the fingers are not around the fruit. On a bench without an arm it stays there."""
        self.opening_mm: Callable[[], float] = lambda: self._opening_mm
        """The gripper's opening now; where no gripper is wired, the one that `force_N` was last called with."""

    @property
    def fruit(self) -> Fruit | None:
        """The fruit in the nest, as it is by now."""
        return self._fruit

    def place(self, fruit: Fruit, pose: Pose | None = None, holder_mm: float = 0.0) -> None:
        """Lay a fruit into the nest, in the place of what was there.

        Args:
            pose: where it meets the gel; the middle where left out.
            holder_mm: room between the fingers that the holder under it takes.
        """
        self._holder_mm = holder_mm
        self._pose = pose or Pose()
        self._since_s = self._worst = None
        self._lay(fruit)

    def remove(self) -> None:
        """Empty the nest: taken, dropped or blown away."""
        self._fruit = self._contact = self._squeeze = self._since_s = self._worst = None

    def width_mm(self, opening_mm: float) -> float:
        """The room between gel and sponge at an opening of the gripper's own pads, 0 to 85 mm."""
        return opening_mm - DIGIT_MM

    def force_N(self, opening_mm: float) -> float:  # noqa: N802 (the gripper's protocol)
        """The force that pushes the fingers apart at an opening of the gripper's own pads, 0 to 85 mm, N."""
        self._opening_mm = opening_mm
        return self._squeezed_at(opening_mm).force_n

    def squeezed(self) -> Squeezed:
        """Return the state of the fruit at the gripper's present opening."""
        return self._squeezed_at(self.opening_mm())

    def touch(self) -> Touch | None:
        """Return the contact on the sensor now, to be drawn; None where nothing touches."""
        squeezed = self.squeezed()
        if self._fruit is None or squeezed.closing_mm <= 0:
            return None
        return Touch(self._contact_on_gel(self._fruit), squeezed)

    def footprint(self) -> Footprint | None:
        """The gel's dent and the true mask now; None where nothing touches."""
        touch = self.touch()
        return touch.contact.pressed(touch.squeezed) if touch else None

    def _squeezed_at(self, opening_mm: float) -> Squeezed:
        if self._fruit is None or self._squeeze is None or self.sensor_mm() is None:
            return Squeezed(-self.width_mm(opening_mm), 0.0, 0.0, 0.0)
        closing_mm = self._fruit.width_mm + self._holder_mm - self.width_mm(opening_mm)
        # Before the curve is read: `_age` may replace it.
        self._age(self._fruit, touching=closing_mm > 0)
        squeezed = self._squeeze.at(closing_mm)
        if squeezed.force_n > self._fruit.variety.yield_n and (
            self._worst is None or squeezed.closing_mm > self._worst.closing_mm
        ):
            self._worst = squeezed
        return squeezed

    def _age(self, fruit: Fruit, *, touching: bool) -> None:
        """Let a held fruit creep, and a released one show what was done to it."""
        if not touching:
            self._since_s = None
            if self._worst:
                self._lay(self._damaged(fruit, self._worst))
                self._worst = None
            elif self._crept_s:
                self._recurve(fruit, 0.0)
            return
        now_s = self._clock.now_s()
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s - self._crept_s >= _CREEP_STEP_S:
            self._recurve(fruit, now_s - self._since_s)

    def _damaged(self, fruit: Fruit, worst: Squeezed) -> Fruit:
        yield_n = fruit.variety.yield_n
        beyond = min(1.0, worst.force_n / yield_n - 1.0)
        set_mm = _SET_SHARE * beyond * worst.closing_mm
        softer = fruit.modulus_mpa * (1.0 - _SOFTENING_MAX * beyond)
        # Jaws closed far beyond a small fruit would leave hardly any of its width.
        return replace(fruit, width_mm=max(0.5 * fruit.width_mm, fruit.width_mm - set_mm), modulus_mpa=softer)

    def _lay(self, fruit: Fruit) -> None:
        self._fruit, self._contact = fruit, None
        # Made now, so that the first touch does not wait until the skin is drawn.
        self._contact_on_gel(fruit)
        self._recurve(fruit, 0.0)

    def _contact_on_gel(self, fruit: Fruit) -> FruitOnGel:
        """The fruit over the gel where the sensor is now, made anew where that has moved."""
        right_mm, down_mm = self.sensor_mm() or (0.0, 0.0)
        place = round(right_mm, _PLACE_DIGITS), round(down_mm, _PLACE_DIGITS)
        if self._contact is None or self._contact[0] != place:
            x_px, y_px = (mm / self._gel.mm_per_px for mm in place)
            # The fruit stays in its place: in the image of a sensor that moved it goes the other way.
            pose = replace(self._pose, x_px=self._pose.x_px - x_px, y_px=self._pose.y_px - y_px)
            self._contact = place, FruitOnGel(fruit, pose, self._gel)
        return self._contact[1]

    def _recurve(self, fruit: Fruit, held_s: float) -> None:
        self._squeeze, self._crept_s = Squeeze(fruit, self._gel, held_s), held_s
