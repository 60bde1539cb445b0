"""The UR10e's kinematics, paths and profiles, without a socket."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from station.twin.ur.body import Body
from station.twin.ur.kinematics import JOINT_SPEED_LIMITS_RAD_S, forward, inverse, nearest
from station.twin.ur.paths import JointPath, UnreachableError
from station.twin.ur.poses import pose_from_transform, rotation_from_vector, transform_from_pose, vector_from_rotation
from station.twin.ur.profile import Braking, Trapezoid

angle = st.floats(-3.1, 3.1)
joints = st.tuples(angle, angle, angle, angle, angle, angle)
positive = st.floats(0.01, 10.0)


def test_stretched_out_the_flange_is_where_the_link_lengths_put_it():
    # All joints at zero: along x the two arms, along y wrist 1 and the tool, along z the base less wrist 2.
    place = forward([0.0] * 6)
    assert place[:3, 3] == pytest.approx([-0.6127 - 0.57155, -0.17415 - 0.11655, 0.1807 - 0.11985], abs=1e-12)
    upright = forward([0.0, -math.pi / 2, 0.0, -math.pi / 2, 0.0, 0.0])
    assert upright[:3, 3] == pytest.approx([0.0, -0.17415 - 0.11655, 0.1807 + 0.6127 + 0.57155 + 0.11985], abs=1e-12)


@given(joints)
def test_every_solution_brings_the_flange_back_and_the_nearest_is_where_it_came_from(q):
    flange = forward(q)
    assume(abs(math.sin(q[4])) > 1e-3)
    assume(abs(math.sin(q[2])) > 1e-3)
    solutions = inverse(flange[None])[0]
    solved = solutions[~np.isnan(solutions).any(axis=1)]
    assert len(solved) >= 2
    assert np.abs(forward(solved) - flange).max() < 1e-6
    assert nearest(solutions, q) == pytest.approx(q, abs=1e-6)


@given(joints, st.sampled_from([0, 3, 5]))
def test_a_joint_beyond_half_a_turn_is_found_again(q, joint):
    assume(abs(math.sin(q[4])) > 1e-3)
    assume(abs(math.sin(q[2])) > 1e-3)
    beyond = list(q)
    beyond[joint] += 2 * math.pi if q[joint] < 0 else -2 * math.pi
    assert nearest(inverse(forward(beyond)[None])[0], beyond) == pytest.approx(beyond, abs=1e-6)


def test_out_of_reach_there_is_no_solution():
    far = transform_from_pose((2.0, 0.0, 0.5, 0.0, 3.14, 0.0))
    assert nearest(inverse(far[None])[0], [0.0] * 6) is None
    inside = transform_from_pose((0.05, 0.0, 0.5, 0.0, 3.14, 0.0))
    assert nearest(inverse(inside[None])[0], [0.0] * 6) is None


@given(st.tuples(angle, angle, angle))
def test_a_rotation_vector_comes_back(vector):
    turned = np.array(vector)
    assume(np.linalg.norm(turned) <= math.pi)
    back = vector_from_rotation(rotation_from_vector(turned))
    assert rotation_from_vector(back) == pytest.approx(rotation_from_vector(turned), abs=1e-9)
    if np.linalg.norm(turned) < math.pi - 1e-3:
        assert back == pytest.approx(turned, abs=1e-8)


def test_half_a_turn_about_any_axis_is_half_a_turn():
    for axis in np.vstack([np.eye(3), [[0.6, 0.8, 0.0]], [[0.0, 0.6, -0.8]]]):
        back = vector_from_rotation(rotation_from_vector(math.pi * axis))
        assert np.linalg.norm(back) == pytest.approx(math.pi, abs=1e-9)
        assert abs(back @ axis) == pytest.approx(math.pi, abs=1e-9)


@given(st.floats(0.0, 10.0), positive, positive)
def test_a_trapezoid_arrives_keeps_its_limits_and_never_goes_back(distance, speed, acceleration):
    profile = Trapezoid(distance, speed, acceleration)
    times = np.linspace(-0.1, profile.duration_s + 0.1, 101)
    travels, speeds = np.array([profile.at(t) for t in times]).T
    assert travels[0] == 0.0
    assert travels[-1] == pytest.approx(distance)
    assert (np.diff(travels) >= -1e-9).all()
    assert speeds.max() <= speed * (1 + 1e-9)
    step_s = times[1] - times[0]
    assert np.abs(np.diff(speeds)).max() <= acceleration * step_s * (1 + 1e-6) + 1e-9
    assert np.diff(travels) == pytest.approx(
        (speeds[1:] + speeds[:-1]) / 2 * step_s, abs=acceleration * step_s**2 + 1e-9
    )


@given(positive, positive)
def test_braking_ends_at_rest_after_the_textbooks_distance(speed, deceleration):
    profile = Braking(1.0, speed, deceleration)
    travel, rest = profile.at(profile.duration_s)
    assert travel - 1.0 == pytest.approx(speed**2 / (2 * deceleration))
    assert rest == pytest.approx(0.0, abs=1e-9)
    assert profile.at(profile.duration_s + 1.0) == (travel, rest)


@pytest.mark.parametrize("values", [(-1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0)])
def test_a_motion_without_speed_is_refused(values):
    with pytest.raises(ValueError, match="no motion"):
        Trapezoid(*values)


@given(joints, joints)
def test_no_joint_goes_faster_than_its_limit(start, end):
    path = JointPath.between(start, end)
    speed = path.speed_limit_rad_s()
    for slope, limit in zip(path.slope, JOINT_SPEED_LIMITS_RAD_S, strict=True):
        assert abs(slope) * speed <= limit * (1 + 1e-9)
    assert path.at(path.length)[0] == pytest.approx(end)


def simulate(body: Body, until_s: float, start_s: float = 0.0, step_s: float = 0.002):
    """Positions and speeds, shape (n, 6), cycle by cycle."""
    positions, speeds = [body.joints_rad], [body.speeds_rad_s]
    for i in range(1, round((until_s - start_s) / step_s)):
        body.advance(start_s + i * step_s, 1.0)
        positions.append(body.joints_rad)
        speeds.append(body.speeds_rad_s)
    return np.array(positions), np.array(speeds)


HOME = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)


def test_a_joint_motion_is_no_faster_than_the_slowest_joint_can():
    body = Body(HOME, 0.0)
    body.move_joints((2.5, -1.5708, 1.5708, 0.0, -1.5708, 0.0), 3.14, 40.0)
    _, speeds = simulate(body, 3.0)
    assert not body.moving
    assert speeds.max(axis=0)[0] == pytest.approx(JOINT_SPEED_LIMITS_RAD_S[0], rel=1e-3)
    assert (np.abs(speeds) <= np.array(JOINT_SPEED_LIMITS_RAD_S) * (1 + 1e-9)).all()


def test_a_straight_tool_motion_is_straight_continuous_and_in_time():
    body = Body(HOME, 0.0)
    body.tcp_offset = (0.0, 0.0, 0.2, 0.0, 0.0, 0.0)
    start = body.tool_pose()
    x, y, z, rx, ry, rz = start
    target = (x + 0.1, y - 0.2, z + 0.15, rx, ry, rz)
    body.move_tool(target, 0.25, 1.0)
    positions, speeds = simulate(body, 2.0)
    assert not body.moving
    assert body.tool_pose() == pytest.approx(target, abs=1e-9)
    tools = np.array([Body.forward(tuple(q), body.tcp_offset)[:3] for q in positions])
    way = np.array(target[:3]) - start[:3]
    along = (tools - start[:3]) @ way / np.linalg.norm(way)
    assert np.linalg.norm(tools - start[:3] - along[:, None] * way / np.linalg.norm(way), axis=1).max() < 1e-5
    assert (np.diff(along) >= -1e-9).all()
    assert np.diff(along).max() / 0.002 == pytest.approx(0.25, rel=0.01)
    assert np.abs(np.diff(positions, axis=0) - 0.002 * (speeds[1:] + speeds[:-1]) / 2).max() < 2e-5


def test_a_stop_on_the_way_stays_on_it_and_brakes_as_asked():
    body = Body(HOME, 0.0)
    body.move_joints((1.5, -1.2, 1.5708, -1.5708, -1.5708, 0.0), 1.0, 4.0)
    simulate(body, 0.6)
    before, speed = np.array(body.joints_rad), body.speeds_rad_s[0]
    assert speed == pytest.approx(1.0)
    body.brake(2.0)
    positions, speeds = simulate(body, 2.0, start_s=0.6)
    assert not body.moving
    assert positions[-1][0] - before[0] == pytest.approx(speed**2 / 4.0, rel=1e-3)
    assert np.abs(np.diff(speeds[1:, 0])).max() <= 2.0 * 0.002 * 1.01
    shares = (positions[-1] - HOME)[:2] / np.array([1.5, 0.3708])
    assert shares[0] == pytest.approx(shares[1])


def test_a_straight_stop_brakes_the_tool_as_asked():
    body = Body(HOME, 0.0)
    body.move_joints((1.5, *HOME[1:]), 1.0, 4.0)
    simulate(body, 0.6)
    tool_m_s = math.hypot(*body.tool_speed()[:3])
    before = body.joints_rad[0]
    body.brake_tool(2.0)
    positions, _ = simulate(body, 2.0, start_s=0.6)
    assert positions[-1][0] - before == pytest.approx(0.5 * 1.0 * tool_m_s / 2.0, rel=1e-3)


def test_slowed_down_it_goes_the_same_way_for_longer():
    body = Body(HOME, 0.0)
    body.move_joints((1.0, *HOME[1:]), 1.0, 4.0)
    for i in range(1, 500):
        body.advance(i * 0.002, 0.25)
        assert abs(body.speeds_rad_s[0]) <= 0.25 + 1e-9
    assert body.moving


@pytest.mark.parametrize("target", [(2.0, 0.0, 0.5, 0.0, 3.14, 0.0), (0.69, 0.174, 0.676, -2.2214, -2.2214, 0.0)])
def test_a_way_that_leaves_reach_is_refused_before_it_begins(target):
    body = Body(HOME, 0.0)
    with pytest.raises(UnreachableError):
        body.move_tool(target, 0.25, 1.0)
    assert not body.moving
    assert body.joints_rad == HOME


def test_pose_and_transform_are_each_others_inverse():
    pose = (0.1, -0.2, 0.3, 0.4, -0.5, 0.6)
    assert pose_from_transform(transform_from_pose(pose)) == pytest.approx(pose)
