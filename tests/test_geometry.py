"""SE(2) is a group, and angles wrap where the docstrings say."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_explore.geometry import Pose, Segment, wrap_angle, wrap_undirected

metres = st.floats(-100.0, 100.0)
angles = st.floats(-20.0, 20.0)
poses = st.builds(Pose, metres, metres, angles)
segments = st.builds(Segment, metres, metres, metres, metres).filter(lambda s: s.length > 1e-3)
IDENTITY = Pose(0.0, 0.0, 0.0)


def same(a: Pose, b: Pose) -> None:
    assert (a.x, a.y, a.heading) == pytest.approx((b.x, b.y, b.heading), abs=1e-9)


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    same((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_the_identity_changes_nothing(a):
    same(a @ IDENTITY, a)
    same(IDENTITY @ a, a)


@given(poses)
def test_a_pose_and_its_inverse_cancel_on_both_sides(a):
    same(a @ a.inverse(), IDENTITY)
    same(a.inverse() @ a, IDENTITY)


@given(poses, poses)
def test_the_inverse_of_a_product_is_the_product_of_the_inverses_turned_round(a, b):
    same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(poses, poses, metres, metres)
def test_composing_poses_composes_what_they_do_to_points(a, b, x, y):
    point = np.array([[x, y]])
    np.testing.assert_allclose((a @ b).transform(point), a.transform(b.transform(point)), atol=1e-9)


@given(poses, segments)
def test_a_rigid_motion_keeps_lengths_and_moves_a_segments_ends_like_points(pose, segment):
    moved = segment.transformed(pose)
    assert moved.length == pytest.approx(segment.length)
    ends = pose.transform(np.array(segment.as_row()).reshape(2, 2))
    np.testing.assert_allclose(np.array(moved.as_row()).reshape(2, 2), ends, atol=1e-9)


@given(poses, segments, metres, metres)
def test_the_distance_from_a_line_is_seen_the_same_from_every_frame(pose, segment, x, y):
    ((px, py),) = pose.transform(np.array([[x, y]]))
    there = segment.transformed(pose).signed_distance(float(px), float(py))
    assert abs(there) == pytest.approx(abs(segment.signed_distance(x, y)), abs=1e-6)


@given(angles)
def test_a_wrapped_angle_is_the_same_direction_in_the_half_open_turn(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.remainder(wrapped - angle, math.tau) == pytest.approx(0.0, abs=1e-9)


@given(angles)
def test_an_undirected_angle_is_the_same_line_in_the_half_open_half_turn(angle):
    wrapped = wrap_undirected(angle)
    assert -math.pi / 2 < wrapped <= math.pi / 2
    assert math.remainder(wrapped - angle, math.pi) == pytest.approx(0.0, abs=1e-9)


def test_straight_back_and_straight_across_wrap_to_the_closed_end():
    assert wrap_angle(-math.pi) == wrap_angle(math.pi) == math.pi
    assert wrap_undirected(-math.pi / 2) == wrap_undirected(math.pi / 2) == math.pi / 2


@given(segments)
def test_a_segment_walked_the_other_way_is_the_same_line(segment):
    back = Segment(segment.x2, segment.y2, segment.x1, segment.y1)
    assert wrap_undirected(back.direction - segment.direction) == pytest.approx(0.0, abs=1e-9)


def test_frames_cancel_in_names():
    pose_robot_in_map = Pose(1.0, 2.0, math.pi / 2)
    pose_sonar_in_robot = Pose(0.1, 0.0, -math.pi / 2)
    same(pose_robot_in_map @ pose_sonar_in_robot, Pose(1.0, 2.1, 0.0))
