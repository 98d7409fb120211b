# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Pose, wheels, chains and points as one estimate: what is learned of one tells of the others."""

import math

import numpy as np
import pytest

from sonar_explore.geometry import Pose, Segment, wrap_angle
from sonar_explore.slam.features import Feature, FeatureKind
from sonar_explore.slam.joint.joint_filter import JointConfig, JointFilter
from sonar_explore.slam.joint.landmarks import BASE, CHAIN, KIND, LINE
from sonar_explore.slam.kalman import SIZE
from sonar_explore.slam.odometry_filter import FilterConfig
from sonar_explore.slam.turn.columns import PointKind
from sonar_explore.slam.turn.points import Point

ON, JOINT = FilterConfig(enabled=True), JointConfig(enabled=True)
START = Pose(0.0, 0.0, 0.0)
TURN_RAD = math.tau
WALL_SIGMA = math.hypot(JOINT.bearing_rad / math.sqrt(8), JOINT.bearing_least_rad)


def wall_at(pose, angle, distance, rng=None):
    """What a robot hears of the line at this bearing and distance from the origin, map frame."""
    depth = distance - pose.x * math.cos(angle) - pose.y * math.sin(angle)
    bearing = wrap_angle(angle - pose.heading)
    if rng is not None:
        depth, bearing = depth + rng.normal(0, JOINT.range_m), bearing + rng.normal(0, WALL_SIGMA)
    segment = Segment(depth, -0.2, depth, 0.2)
    return Feature(FeatureKind.WALL, bearing, depth, 0.4, segment, (), bearing % math.tau, 8)


def point_at(pose, x, y, rng=None):
    """What a robot hears of an edge."""
    depth, bearing = math.hypot(x - pose.x, y - pose.y), math.atan2(y - pose.y, x - pose.x) - pose.heading
    if rng is not None:
        depth, bearing = (
            depth + rng.normal(0, JOINT.point_range_m),
            bearing + rng.normal(0, JOINT.point_bearing_rad),
        )
    return Point(wrap_angle(bearing), depth, wrap_angle(bearing) % math.tau, 6)


class Walk:
    """A robot with random errors, and what the filter believes of it."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.filter = JointFilter(ON, JOINT)
        self.true = self.believed = self.odometry = START
        self.bend = self.rng.normal(0, ON.bend_rad_m)

    def drive(self, metres, turn=0.0):
        """Turn, then straight on."""
        self._bit(0.0, turn)
        for _ in range(round(metres / 0.05)):
            self._bit(0.05, 0.0)

    def _bit(self, forward, turn):
        after = self.odometry @ Pose(forward, 0.0, turn)
        self.believed = self.filter.moved(self.believed, self.odometry, after)
        slip = self.rng.normal(
            0, math.sqrt(ON.turn_rad**2 * abs(turn) / math.tau + ON.drift_rad**2 * forward)
        )
        along = forward + self.rng.normal(0, ON.distance_m * math.sqrt(forward))
        self.odometry = after
        self.true = self.true @ Pose(along, 0.0, turn + slip + self.bend * forward)

    @property
    def off(self):
        """Error of x, y, heading."""
        d = self.believed
        return np.array([d.x - self.true.x, d.y - self.true.y, wrap_angle(d.heading - self.true.heading)])

    def hear(self, lines, points, scan):
        """Scan: lines by chain (angle, distance), points by place; what is not known yet is added."""
        known = [c for c in lines if self.filter.line(c, (0.0, 0.0)) is not None]
        heard = {c: wall_at(self.true, line[0], line[1], self.rng) for c, line in lines.items()}
        self.believed = self.filter.by_walls(self.believed, [heard[c] for c in known], known, (), scan)
        found = [point_at(self.true, p[0], p[1], self.rng) for p in points]
        self.believed = self.filter.by_points(self.believed, found, scan)
        for chain in lines:
            if chain not in known:
                self.filter.add_wall(chain, self.believed, heard[chain], scan)


ROOM = {0: (0.0, 1.5), 1: (math.pi / 2, 1.2), 2: (math.pi, 1.5), 3: (-math.pi / 2, 1.2)}
BEYOND = {4: (0.0, 6.0), 5: (math.pi / 2, 1.0)}
EDGES = [(1.5, 0.5), (-0.5, 1.2)]


def there_and_back(seed):
    """Hear a room, drive where nothing of it is heard, hear other walls, come back."""
    walk = Walk(seed)
    walk.hear(ROOM, EDGES, 0)
    walk.drive(4.0)
    walk.hear(BEYOND, [(5.0, 0.8)], 1)
    return walk


def line_off(walk, chain, angle, distance):
    """Error of a chain's line: angle, and distance at the middle of where it is heard."""
    line = walk.filter.line(chain, (5.0, 0.5))
    x, y = line.midpoint
    normal = line.direction - math.pi / 2
    turn = math.remainder(normal - angle, math.pi)
    return np.array([turn, x * math.cos(angle) + y * math.sin(angle) - distance])


def test_errors_are_as_large_as_the_covariance_says():
    """The mean of the squared Mahalanobis distance of three numbers is three."""
    squares = []
    for seed in range(60):
        walk = there_and_back(seed)
        walk.drive(4.0, math.pi)
        walk.hear(ROOM, EDGES, 2)
        walk.drive(1.0, 0.4)
        walk.filter.walls_believable(walk.believed, [wall_at(walk.true, *ROOM[0])], [0])
        squares.append(walk.off @ np.linalg.solve(walk.filter.full_covariance[:3, :3], walk.off))
    assert 1.5 < np.mean(squares) < 5.0


def test_who_comes_back_to_old_chains_knows_the_young_ones_better():
    before, after = [], []
    for seed in range(30):
        walk = there_and_back(seed)
        before.append(np.abs([line_off(walk, c, *BEYOND[c]) for c in BEYOND]))
        walk.drive(4.0, math.pi)
        walk.hear(ROOM, EDGES, 2)
        after.append(np.abs([line_off(walk, c, *BEYOND[c]) for c in BEYOND]))
    angle, distance = (np.mean(after, axis=0) / np.mean(before, axis=0)).T
    assert (angle < 0.6).all()
    assert distance[1] < 0.6  # the wall along the way: how far it lies aside


def test_two_chains_that_are_one_line_close_the_gap_between_robot_and_map():
    before, after = [], []
    for seed in range(20):
        walk = there_and_back(seed)
        before.append(abs(walk.off[1]))
        seen = wall_at(walk.true, *ROOM[1])
        walk.filter.add_wall(9, walk.believed, seen, 2)
        walk.believed = walk.filter.by_walls(walk.believed, [seen], [1], [(1, 9)], 2)
        after.append(abs(walk.off[1]))
        one, other = walk.filter.line(1, (3.0, 1.0)), walk.filter.line(9, (3.0, 1.0))
        assert abs(math.remainder(one.direction - other.direction, math.pi)) < math.radians(0.3)
        assert abs(one.midpoint[1] - other.midpoint[1]) < 0.01
    assert np.mean(after) < 0.5 * np.mean(before)


def test_a_wall_far_from_its_chain_is_not_believable():
    walk = Walk(0)
    walk.hear(ROOM, (), 0)
    walk.drive(0.5)
    good, turned, moved = (wall_at(walk.true, a, d) for a, d in ((0.0, 1.5), (0.5, 1.5), (0.0, 1.9)))
    assert walk.filter.walls_believable(walk.believed, [good, turned, moved], [0, 0, 0]).tolist() == [
        True,
        False,
        False,
    ]


def test_points_are_known_again_and_stop_the_robot_from_sliding_along_a_corridor():
    with_points: list[float] = []
    without: list[float] = []
    again: list[bool] = []
    for seed in range(20):
        for edges, errors in ((EDGES, with_points), ((), without)):
            walk = Walk(seed)
            walls = {c: ROOM[c] for c in (1, 3)}
            walk.hear(walls, edges, 0)
            walk.drive(1.0)
            walk.hear(walls, edges, 1)
            errors.append(abs(walk.off[0]))
            known = np.count_nonzero(walk.filter.landmarks[:, KIND] != LINE)
            again.append(known == len(edges))
    assert np.mean(with_points) < 0.5 * np.mean(without)
    assert np.mean(again) > 0.8


def test_a_point_of_another_kind_is_another_point():
    walk = Walk(0)
    edge = point_at(START, 1.0, 0.3)
    column = Point(edge.bearing_rad, edge.range_m, edge.sweep_rad, 6, PointKind.COLUMN, 0.05)
    walk.filter.by_points(START, [edge], 0)
    walk.filter.by_points(START, [column], 1)
    assert sorted(walk.filter.landmarks[:, KIND]) == [PointKind.EDGE, PointKind.COLUMN]


def test_to_drop_a_landmark_leaves_all_others_as_they_were():
    walk = there_and_back(3)
    full = walk.filter.full_covariance.copy()
    lines = {c: walk.filter.line(c, (0.0, 0.0)) for c in ROOM if c != 1}
    slot = int(np.flatnonzero(walk.filter.landmarks[:, CHAIN] == 1)[0])
    walk.filter.drop_wall(1)
    assert walk.filter.line(1, (0.0, 0.0)) is None
    assert {c: walk.filter.line(c, (0.0, 0.0)) for c in lines} == lines
    left = np.array([*range(BASE), *range(BASE, len(full))])
    gone = BASE + 2 * slot
    left = left[(left != gone) & (left != gone + 1)]
    expected = np.sort(np.linalg.eigvalsh(full[np.ix_(left, left)]))
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(walk.filter.full_covariance)), expected, atol=1e-9)


def test_points_heard_once_are_forgotten_and_no_more_than_so_many_landmarks_are_kept():
    walk = Walk(0)
    walk.hear(ROOM, EDGES, 0)
    walk.believed = walk.filter.by_points(walk.believed, [point_at(walk.true, *EDGES[0])], 1)
    walk.filter.forget(JOINT.forget_scans - 1)
    assert len(walk.filter.landmarks) == 6
    walk.filter.forget(JOINT.forget_scans)
    assert len(walk.filter.landmarks) == 5
    few = JointFilter(ON, JointConfig(enabled=True, most_landmarks=3))
    for chain, line in ROOM.items():
        few.add_wall(chain, START, wall_at(START, *line), chain)
    few.forget(4)
    assert [few.line(c, (0.0, 0.0)) is not None for c in ROOM] == [False, True, True, True]


def test_an_adopted_chain_corrects_like_any_other():
    walk = Walk(0)
    walk.drive(1.0)
    walk.filter.adopt(7, Segment(0.0, 1.0, 1.0, 1.0), 0)
    before = abs(walk.off[1])
    seen = wall_at(walk.true, math.pi / 2, 1.0)
    assert walk.filter.walls_believable(walk.believed, [seen], [7]).all()
    walk.believed = walk.filter.by_walls(walk.believed, [seen], [7], (), 1)
    assert abs(walk.off[1]) < before


@pytest.mark.parametrize("seed", range(3))
def test_the_covariance_stays_one(seed):
    walk = there_and_back(seed)
    full = walk.filter.full_covariance
    np.testing.assert_allclose(full, full.T, atol=1e-15)
    assert np.linalg.eigvalsh(full).min() > -1e-12
    assert full[:SIZE, :SIZE] == pytest.approx(walk.filter.covariance)


def test_the_scale_of_ranges_is_learned_where_opposite_walls_are_heard_from_many_places():
    walk, scale = Walk(1), 0.01
    for scan in range(12):
        for chain, line in {0: ROOM[0], 2: ROOM[2]}.items():
            seen = wall_at(walk.true, *line)
            seen = Feature(
                seen.kind, seen.bearing_rad, seen.range_m / (1 + scale), 0.4, seen.segment, (), 0.0, 8
            )
            if walk.filter.line(chain, (0.0, 0.0)) is None:
                walk.filter.add_wall(chain, walk.believed, seen, scan)
            else:
                walk.believed = walk.filter.by_walls(walk.believed, [seen], [chain], (), scan)
        walk.drive(0.5, math.pi if scan % 2 else 0.0)
    assert walk.filter.range_scale > 0.0
    assert walk.filter.full_covariance[SIZE, SIZE] < JOINT.range_scale**2
