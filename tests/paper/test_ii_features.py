# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section II: regions of constant depth make walls, corners and edges."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import CENTRED, RANGE_MAX, ROBOT, half_angle, rectangle, scan_room

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose, Segment
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import FeatureConfig, FeatureKind, compensated_ranges, extract_features

CONFIG = FeatureConfig()
ROOM, CORNERS = rectangle(2.6, 2.2)
INSIDE = Pose(1.2, 0.9, 0.3)


def walls(scan):
    return [f for f in extract_features(scan, CONFIG) if f.kind is FeatureKind.WALL]


def in_map(features, pose):
    """Rounded (kind, bearing in the map, range), in an order of its own."""
    return sorted(
        (f.kind, round(math.remainder(f.bearing_rad + pose.heading, math.tau), 6), round(f.range_m, 6))
        for f in features
    )


def wall_at(range_m):
    return [Segment(range_m, -3.0, range_m, 3.0)]


def test_the_synthetic_sonar_hears_what_reading_2_says():
    degrees = [math.degrees(half_angle(r)) for r in (0.5, 1.0, 2.0)]
    assert degrees == pytest.approx([13.6, 12.5, 11.3], abs=0.06)
    assert math.degrees(half_angle(2.0, 0.1, 1.5)) == pytest.approx(4.4, abs=0.06)


@pytest.mark.parametrize("n", [72, 90, 180, 360])
@pytest.mark.parametrize("range_m", [0.4, 1.0, 2.0])
def test_a_plane_within_two_metres_is_a_wall_at_its_foot(n, range_m):
    (wall,) = walls(scan_room(Pose(0, 0, 0.1), wall_at(range_m), n=n, sonar=CENTRED))
    assert wall.range_m == pytest.approx(range_m, abs=1e-9)
    assert abs(math.remainder(wall.bearing_rad + 0.1, math.tau)) <= math.tau / n
    assert wall.segment.length == pytest.approx(2 * range_m * math.tan(wall.width_rad / 2))


@pytest.mark.parametrize("n", [72, 90, 180, 360])
def test_a_far_edge_is_too_narrow_for_a_wall(n):
    for bearing in np.linspace(0.0, 0.2, 12):
        scan = scan_room(Pose(0, 0, float(bearing)), [], edges=[(2.0, 0.0)], n=n, sonar=CENTRED)
        assert walls(scan) == []


def test_a_near_edge_passes_for_a_wall_and_a_farther_one_is_an_edge():
    near = extract_features(scan_room(CENTRED, [], edges=[(0.4, 0.0)], sonar=CENTRED), CONFIG)
    far = extract_features(scan_room(CENTRED, [], edges=[(1.5, 0.0)], sonar=CENTRED), CONFIG)
    assert [f.kind for f in near] == [FeatureKind.WALL]
    assert [f.kind for f in far] == [FeatureKind.EDGE]
    assert far[0].segment.length == 0.0


def test_a_plane_beyond_the_reliable_range_is_no_feature():
    assert extract_features(scan_room(CENTRED, wall_at(2.3), sonar=CENTRED), CONFIG) == ()


@pytest.mark.parametrize("sonar", range(8))
def test_the_offset_of_any_sonar_is_compensated(sonar):
    (wall,) = walls(scan_room(CENTRED, wall_at(1.5), sonar=ROBOT.sonars[sonar], n=360))
    assert wall.range_m == pytest.approx(1.5, abs=0.004)
    assert abs(wall.bearing_rad) <= math.radians(1.0)


def test_readings_are_counted_from_the_centre_of_the_robot():
    scan = scan_room(CENTRED, wall_at(1.5))
    mount = scan.pose_sonar_in_robot
    lever = mount.x * math.cos(mount.heading) + mount.y * math.sin(mount.heading)
    assert compensated_ranges(scan) == pytest.approx(scan.ranges_m + lever)


def test_a_room_has_four_walls_and_its_near_corners():
    scan = scan_room(INSIDE, ROOM, CORNERS)
    features = extract_features(scan, CONFIG)
    assert sorted(round(w.range_m, 1) for w in walls(scan)) == [0.9, 1.2, 1.3, 1.4]
    corners = [f for f in features if f.kind is FeatureKind.CORNER]
    for corner in corners:
        foot = Pose(0, 0, INSIDE.heading + corner.bearing_rad).transform(np.array([[corner.range_m, 0.0]]))[0]
        nearest = min(math.hypot(foot[0] + INSIDE.x - x, foot[1] + INSIDE.y - y) for x, y in CORNERS)
        assert nearest < 0.1
    assert len(corners) == 4


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 89))
def test_the_seam_of_the_scan_is_invisible(turned):
    pose = Pose(INSIDE.x, INSIDE.y, INSIDE.heading + math.radians(4.0 * turned))
    once = extract_features(scan_room(INSIDE, ROOM, CORNERS), CONFIG)
    other = extract_features(scan_room(pose, ROOM, CORNERS), CONFIG)
    assert in_map(once, INSIDE) == in_map(other, pose)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.7, 1.9), st.floats(0.7, 1.5), st.floats(-3.0, 3.0), st.sampled_from([72, 90, 180]))
def test_the_direction_of_the_spin_does_not_matter(x, y, heading, n):
    pose = Pose(x, y, heading)
    left, right = (
        extract_features(scan_room(pose, ROOM, CORNERS, n=n, spin=spin), CONFIG) for spin in (1, -1)
    )
    assert in_map(left, pose) == in_map(right, pose)


def test_a_slow_drift_does_not_chain_on():
    headings = np.arange(90) * math.tau / 90
    drifting = Scan(CENTRED, headings, np.linspace(0.5, 1.75, 90), CENTRED, RANGE_MAX)
    for feature in extract_features(drifting, CONFIG):
        heard = drifting.ranges_m[list(feature.readings)]
        assert np.abs(heard - np.median(heard)).max() <= CONFIG.tolerance_m + 1e-9


def ranges_with(plateaus):
    """A scan by the degree that hears nothing but the plateaus {(from, to): depth}."""
    ranges = np.full(360, RANGE_MAX)
    for (first, last), depth in plateaus.items():
        ranges[first : last + 1] = depth
    return Scan(CENTRED, np.arange(360) * math.tau / 360, ranges, CENTRED, RANGE_MAX)


def test_a_run_wider_than_a_beam_is_one_wall_at_its_middle_no_longer_than_one_and_a_half_beams():
    (wall,) = walls(ranges_with({(40, 100): 0.4}))
    assert math.degrees(wall.bearing_rad) == pytest.approx(70.0)
    assert wall.segment.length == pytest.approx(2 * 0.4 * math.tan(math.radians(37.5 / 2)))


def test_a_robot_surrounded_at_one_depth_sees_no_wall():
    assert walls(ranges_with({(0, 359): 0.9})) == []


def test_the_shoulder_of_a_plateau_is_no_wall():
    (wall,) = walls(ranges_with({(40, 70): 0.40, (71, 90): 0.46}))
    assert wall.range_m == pytest.approx(0.40)


def test_two_walls_side_by_side_with_a_jump_between_are_two():
    assert len(walls(ranges_with({(40, 60): 0.40, (61, 80): 0.60}))) == 2


@pytest.mark.parametrize("bad", [math.nan, math.inf, -0.1])
def test_a_range_that_is_no_range_is_refused_in_one_line(bad):
    scan = scan_room(CENTRED, wall_at(1.0))
    scan.ranges_m[7] = bad
    with pytest.raises(SonarExploreError) as error:
        extract_features(scan, CONFIG)
    assert "\n" not in str(error.value)


def test_headings_and_ranges_of_different_shapes_are_refused():
    with pytest.raises(SonarExploreError, match="one shape"):
        extract_features(Scan(CENTRED, np.arange(90.0), np.ones(80), CENTRED, 5.0), CONFIG)


def test_headings_that_turn_back_are_refused():
    with pytest.raises(SonarExploreError, match="one way"):
        extract_features(Scan(CENTRED, np.array([0.0, 1.0, 0.5, 2.0]), np.ones(4), CENTRED, 5.0), CONFIG)
