"""The closed path of least cost around a contact."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from station.vision.contour import closed_path

RAYS, STEPS = 12, 9


def followed_from_one_end(cost, stiffness):
    """The same path, one ray after the other and each jump tried."""
    turns = np.concatenate([cost, cost[: RAYS // 2]])
    best, ways = turns[0], [[step] for step in range(STEPS)]
    for row in turns[1:]:
        before = [
            min(
                (best[start] + stiffness * (start - step) ** 2, start)
                for start in range(max(0, step - 2), min(STEPS, step + 3))
            )
            for step in range(STEPS)
        ]
        ways = [[*ways[start], step] for step, (_, start) in enumerate(before)]
        best = row + np.array([price for price, _ in before])
    start = RAYS // 4
    return np.roll(ways[int(best.argmin())][start : start + RAYS], start)


@settings(deadline=None)
@given(seed=st.integers(0, 10_000), stiffness=st.floats(0, 2))
def test_it_is_the_one_that_is_found_by_following_it_from_one_end(seed, stiffness):
    cost = -np.random.default_rng(seed).random((RAYS, STEPS))
    assert closed_path(cost, stiffness).tolist() == followed_from_one_end(cost, stiffness).tolist()


def test_it_keeps_to_a_cheap_ring_and_bridges_a_gap_in_it():
    cost = np.zeros((64, 64))
    cost[:, 30] = -1
    cost[20:24] = 0
    assert (closed_path(cost, 0.1) == 30).all()
