from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.twin.contact import FruitOnGel, Pose
from station.twin.damage import DAMAGES, Damage, Severity, SoftPatch
from station.twin.fruit import Kind, draw_fruit
from station.twin.gel import Gel
from station.twin.process import Twin, TwinOptions
from station.twin.squeeze import Squeeze

FRUITS = (Kind.STRAWBERRY, Kind.RASPBERRY, Kind.BLUEBERRY)


def area_mm2(fruit, closing_mm=3.0):
    return FruitOnGel(fruit, Pose(), Gel()).pressed(Squeeze(fruit, Gel()).at(closing_mm)).true_area_mm2


@pytest.mark.parametrize("kind", FRUITS)
def test_the_area_grows_with_the_severity(kind):
    sound = draw_fruit(kind, 3)
    areas = [area_mm2(replace(sound, bruised=True, damage=DAMAGES[each])) for each in Severity]
    severe, mild, patch = (area / area_mm2(sound) for area in areas)
    assert 1.5 < severe < 1.9
    assert 1.2 < mild < 1.4
    assert 1.1 < patch < 1.25


def test_a_bruise_is_the_severe_one_unless_told_otherwise():
    assert draw_fruit(Kind.RASPBERRY, 1, bruised=True).damage == DAMAGES[Severity.SEVERE]
    assert area_mm2(draw_fruit(Kind.RASPBERRY, 1, damage=DAMAGES[Severity.MILD])) == area_mm2(
        draw_fruit(Kind.RASPBERRY, 1)
    )


def test_a_load_lies_over_the_patch_under_it_and_not_beside_it():
    radii = np.array([0.0, 2.0, 4.0, 8.0])
    middle = SoftPatch(4.0, 0.5).load_share(radii)
    # Johnson, Contact Mechanics, 4.22: of Hertz's load 1 - (1 - r²/a²)^(3/2) is within r.
    assert middle == pytest.approx([1.0, 1.0, 1.0, 1.0 - 0.75**1.5], abs=0.02)
    assert SoftPatch(4.0, 0.5, x_mm=13.0).load_share(radii) == pytest.approx([0.0, 0.0, 0.0, 0.0])
    aside = SoftPatch(4.0, 0.5, y_mm=4.0).load_share(radii[1:])
    # A contact whose middle is on the patch's edge: less than half of its load, the less the wider it is.
    assert 0.5 > aside[0] > aside[1] > aside[2] > 0


def test_a_patch_as_wide_as_the_fruit_is_softness_alone():
    fruit = draw_fruit(Kind.STRAWBERRY, 5, bruised=True, damage=Damage(patch=SoftPatch(30.0, 0.6)))
    assert area_mm2(fruit) == area_mm2(replace(fruit, damage=Damage(softening=0.6)))


def test_a_patch_beside_the_gel_is_not_felt():
    fruit = draw_fruit(Kind.STRAWBERRY, 5, bruised=True, damage=Damage(patch=SoftPatch(4.0, 0.3, y_mm=-15.0)))
    assert area_mm2(fruit) == area_mm2(replace(fruit, bruised=False))


@settings(deadline=None, max_examples=30)
@given(st.sampled_from(FRUITS), st.floats(0.5, 8), st.floats(0.1, 1), st.floats(-8, 8), st.floats(-8, 8))
def test_the_force_never_falls_as_the_contact_grows_onto_a_patch(kind, radius_mm, softening, x_mm, y_mm):
    damage = Damage(patch=SoftPatch(radius_mm, softening, x_mm, y_mm))
    squeeze = Squeeze(draw_fruit(kind, 1, bruised=True, damage=damage), Gel())
    steps = [squeeze.at(closing_mm) for closing_mm in np.linspace(0, 8, 81)]
    assert (np.diff([step.force_n for step in steps]) >= 0).all()


def test_the_twin_lays_fruit_by_severity_and_refuses_one_that_it_does_not_know():
    twin = Twin(TwinOptions(bench=True))
    twin._lay({"kind": "blueberry", "bruised": True, "severity": "mild"})
    assert twin.world.fruit is not None
    assert twin.world.fruit.damage == DAMAGES[Severity.MILD]
    with pytest.raises(ValueError, match="severity: expected one of severe, mild, patch, found 'dreadful'"):
        twin._lay({"kind": "blueberry", "bruised": True, "severity": "dreadful"})
