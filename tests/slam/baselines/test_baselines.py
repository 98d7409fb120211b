# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The methods to compare with: right where nothing errs, better than dead reckoning where the wheels do."""

import math

import numpy as np
import pytest
from a_drive import log_of_a_drive
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam import Feature, FeatureKind, make_slam
from sonar_explore.slam.baselines.end_points import end_points, placed
from sonar_explore.slam.baselines.particles import ParticleConfig, ParticleFilter
from sonar_explore.slam.baselines.scan_matching import PastScans, ScanMatchConfig, turned

BASELINES = ("grid-pf", "scan-match")
START = Pose(0.5, 0.5, 0.0)  # of log_of_a_drive
ROOM = ((math.pi, 0.0), (0.0, 4.0), (-math.pi / 2, 0.0), (math.pi / 2, 3.0))
"""Bearing of each wall's outward normal, and its distance from the origin along it."""
SPREAD = np.diag([0.05, 0.05, 0.05]) ** 2


def replayed(name, log):
    slam = make_slam(name, START)
    for entry in log:
        slam.predict(entry) if isinstance(entry, Pose) else slam.update(entry)
    return slam


def seen(pose, walls=ROOM):
    """What an extractor without error would say at a pose."""
    features = []
    for normal, distance in walls:
        r, bearing = distance - pose.x * math.cos(normal) - pose.y * math.sin(normal), normal - pose.heading
        c, s = math.cos(bearing), math.sin(bearing)
        tangent = Segment(r * c + 0.2 * s, r * s - 0.2 * c, r * c - 0.2 * s, r * s + 0.2 * c)
        features.append(Feature(FeatureKind.WALL, bearing, r, 0.3, tangent, (0,)))
    return tuple(features)


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_is_nearer_the_truth_than_dead_reckoning(name):
    def error(slam, true):
        return np.mean([e.pose.distance_to(t) for e, t in zip(slam.scans, true, strict=True)])

    logs = [log_of_a_drive(seed) for seed in range(6)]
    found, blind = ([error(replayed(n, log), true) for log, true in logs] for n in (name, "off"))
    assert np.mean(found) < 0.7 * np.mean(blind)


@pytest.mark.parametrize("name", BASELINES)
def test_the_same_log_gives_the_same_poses_and_chains_lie_where_their_scans_do(name):
    log, _ = log_of_a_drive(7)
    slam, again = replayed(name, log), replayed(name, log)
    assert [e.pose for e in slam.scans] == [e.pose for e in again.scans]
    assert len(slam.chains)
    for chain in slam.chains.chains:
        for link in chain.links:
            expected = link.feature.segment.transformed(slam.scans[link.scan].pose)
            assert link.segment.as_row() == pytest.approx(expected.as_row())


@pytest.mark.parametrize("name", BASELINES)
def test_who_is_told_the_pose_believes_it(name):
    log, _ = log_of_a_drive(1)
    scans = [entry for entry in log if not isinstance(entry, Pose)][:2]
    slam = make_slam(name, START)
    slam.update(scans[0])
    told = Pose(2.0, 0.6, 0.3)
    slam.place(told)
    assert slam.update(scans[1]).pose.distance_to(told) < 1e-6


@settings(max_examples=30)
@given(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08), st.floats(-0.08, 0.08))
def test_scan_matching_comes_back_to_the_truth_from_a_bad_prediction(dx, dy, turn):
    past, first, second = PastScans(ScanMatchConfig()), Pose(1.5, 1.5, 0.2), Pose(1.7, 1.6, 0.5)
    past.add(first, end_points(seen(first)))
    bad = Pose(second.x + dx, second.y + dy, second.heading + turn)
    found = past.match(bad, SPREAD, end_points(seen(second)))
    assert found.distance_to(second) < 0.02 and abs(found.heading - second.heading) < 0.01


def test_between_two_parallel_walls_scan_matching_leaves_the_way_along_them_to_the_odometry():
    corridor = (ROOM[2], ROOM[3])
    past, first = PastScans(ScanMatchConfig()), Pose(1.5, 1.5, 0.0)
    past.add(first, end_points(seen(first, corridor)))
    found = past.match(Pose(1.65, 1.55, 0.04), SPREAD, end_points(seen(Pose(1.6, 1.5, 0.0), corridor)))
    assert found.x == pytest.approx(1.65, abs=0.01)
    assert found.y == pytest.approx(1.5, abs=0.01) and found.heading == pytest.approx(0.0, abs=0.01)


def test_a_scan_of_another_place_moves_nothing():
    past, first = PastScans(ScanMatchConfig()), Pose(1.5, 1.5, 0.0)
    past.add(first, end_points(seen(first)))
    predicted = Pose(8.0, 8.0, 0.0)
    assert past.match(predicted, SPREAD, end_points(seen(first))).distance_to(predicted) < 1e-6
    assert past.match(predicted, SPREAD, end_points(())) == predicted


@given(st.floats(-math.pi, math.pi))
def test_a_covariance_turned_into_the_map_keeps_its_size_and_its_heading(heading):
    there = turned(np.diag([0.04, 0.01, 0.02]), heading)
    assert np.linalg.eigvalsh(there[:2, :2]) == pytest.approx([0.01, 0.04])
    assert there[2, 2] == pytest.approx(0.02)
    along = np.array([math.cos(heading), math.sin(heading), 0.0])
    assert along @ there @ along == pytest.approx(0.04)


def test_points_lie_on_the_walls_that_they_are_of():
    pose = Pose(1.2, 0.9, 0.7)
    points = end_points(seen(pose))
    xy, normals = placed(points, np.array([[pose.x, pose.y, pose.heading]]))
    for point, normal in zip(xy[0], normals[0], strict=True):
        off = [
            abs(point @ (math.cos(n), math.sin(n)) - d) for n, d in ROOM if abs(math.sin(n - normal)) < 1e-6
        ]
        assert min(off) < 1e-9
    assert points.foot.sum() == len(ROOM) and points.weight.sum() == pytest.approx(len(ROOM))


def test_particles_gather_where_the_scan_fits_and_spread_where_nothing_is_heard():
    start, true = Pose(1.5, 1.5, 0.0), Pose(1.9, 1.5, 0.0)
    spread, motion = np.diag([0.05, 0.05, 0.04]) ** 2, Pose(0.45, 0.03, 0.03)  # off by as much as it may be
    found = {}
    for walls in (ROOM, ()):
        particles = ParticleFilter(start, ParticleConfig())
        particles.weigh(end_points(seen(start, walls)))
        particles.move(motion, spread)
        particles.weigh(end_points(seen(true, walls)))
        found[len(walls)] = particles
    near, blind = found[4], found[0]
    assert near.poses.std(axis=0)[2] < 0.7 * blind.poses.std(axis=0)[2]
    assert np.abs(near.path[-1] - (true.x, true.y, true.heading)).max() < 0.025
    assert blind.path[-1] == pytest.approx([1.95, 1.53, 0.03], abs=0.03)


def test_few_particles_that_fit_take_over_from_the_rest_with_their_ways():
    config = ParticleConfig(resample_below=1.0)
    particles = ParticleFilter(Pose(1.5, 1.5, 0.0), config)
    particles.weigh(end_points(seen(Pose(1.5, 1.5, 0.0))))
    particles.move(Pose(0.4, 0.0, 0.0), np.diag([0.2, 0.2, 0.2]) ** 2)
    particles.weigh(end_points(seen(Pose(1.9, 1.5, 0.0))))
    assert len(np.unique(particles.poses, axis=0)) < config.particles
    assert particles.path[0] == pytest.approx((1.5, 1.5, 0.0), abs=0.0)
