"""Places that strangers, greedy holders and known ones share."""

from dataclasses import dataclass

import pytest

from station.serving.places import FLOOD_BURST, FLOOD_S, Places


class Clock:
    def __init__(self):
        self.now_s = 1000.0

    def __call__(self):
        return self.now_s


@dataclass(eq=False)
class Guest:
    holder: str
    known: bool = False
    rank: tuple[float, ...] | None = (0.0,)
    displaced: bool = False

    def displace(self):
        self.displaced = True


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def places(clock):
    return Places(most=6, per_holder=4, reserve=4, clock=clock)


def enter(places, *guests):
    return [places.enter(guest) for guest in guests]


def test_a_holder_with_all_its_places_displaces_its_own_first(places):
    other, mine = Guest("b", rank=(-1.0,)), [Guest("a", rank=(float(number),)) for number in range(4)]
    assert enter(places, other, *mine, Guest("a")) == [True] * 6
    assert [guest.displaced for guest in (other, *mine)] == [False, True, False, False, False]


def test_in_a_full_house_the_holder_with_most_gives_way(places):
    mine = [Guest("a", rank=(5.0,)) for _ in range(4)]
    others = [Guest("b"), Guest("c")]
    enter(places, *mine, *others)
    assert places.enter(Guest("d"))
    assert [guest.displaced for guest in others] == [False, False]
    assert [guest.displaced for guest in mine].count(True) == 1


def test_who_does_not_give_way_keeps_the_place_and_the_newcomer_is_refused(places):
    enter(places, *(Guest("a", rank=None) for _ in range(4)))
    assert not places.enter(Guest("a"))
    assert places.enter(Guest("b"))


def test_known_holders_have_places_that_no_stranger_takes(places):
    known = [Guest("k", known=True) for _ in range(4)]
    strangers = [Guest(f"s{number}", rank=None) for number in range(40)]
    enter(places, *strangers)
    assert enter(places, *known) == [True] * 4
    enter(places, *strangers)
    assert not any(guest.displaced for guest in known)
    assert not places.enter(Guest("s"))


def test_a_place_is_free_again_behind_who_left(places):
    guests = [Guest("a", rank=None) for _ in range(4)]
    enter(places, *guests)
    places.leave(guests[0])
    places.leave(guests[0])
    assert places.enter(Guest("a", rank=None))
    assert not places.enter(Guest("a"))


def test_a_flood_names_who_holds_most_and_ends(places, clock):
    enter(places, *(Guest("a", rank=None) for _ in range(4)), Guest("b", rank=None), Guest("c", rank=None))
    enter(places, *(Guest("d") for _ in range(FLOOD_BURST)))
    assert places.flooded_by == "", "some too many at once are none"
    places.enter(Guest("d"))
    assert places.flooded_by == "a"
    clock.now_s += FLOOD_S - 1
    assert places.flooded_by == "a"
    clock.now_s += 2
    assert places.flooded_by == ""
