# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The yardstick: right where measurements are, near the truth where they are not, and never fooled by edges."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.load import load_world
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam import Feature, FeatureKind, SlamConfig, make_slam
from sonar_explore.studies.compare.drives import record_drive
from sonar_explore.studies.compare.oracle import OracleConfig, oracle, straight_walls, true_walls

FEATURES, AGREEMENT = SlamConfig.robust().features, SlamConfig.robust().agreement
SHORT = ExplorationConfig(max_scans=14)


@pytest.fixture(scope="module", params=["ideal", "paper", "worn"])
def drive_and_noise(request):
    return record_drive("paper/bend", request.param, seed=3, config=SHORT), request.param


def seen(bearing_rad, range_m, kind=FeatureKind.WALL, sweep_rad=0.0):
    """A feature as an extractor would report it."""
    x, y = range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad)
    return Feature(kind, bearing_rad, range_m, 0.3, Segment(x, y, x, y), (0,), sweep_rad)


def errors(poses, drive):
    return np.array([p.distance_to(t) for p, t in zip(poses, drive.true_poses, strict=True)])


def test_the_oracle_is_nearer_the_truth_than_dead_reckoning(drive_and_noise):
    drive, noise = drive_and_noise
    found = errors(oracle(drive, noise_preset(noise), FEATURES, AGREEMENT).poses, drive)
    slam = make_slam("off", drive.world.start)
    for entry in drive.log:
        slam.predict(entry) if isinstance(entry, Pose) else slam.update(entry)
    blind = errors([e.pose for e in slam.scans], drive)
    assert found.max() < {"ideal": 0.03, "paper": 0.2, "worn": 0.3}[noise]
    assert noise == "ideal" or found.mean() < 0.7 * blind.mean()


def test_with_wheels_that_do_not_err_the_oracle_is_off_by_millimetres():
    drive = record_drive("paper/corridor", "ideal", seed=1, config=SHORT)
    assert errors(oracle(drive, noise_preset("ideal"), FEATURES, AGREEMENT).poses, drive).max() < 0.005


def test_the_same_seed_gives_the_same_drive_and_another_seed_another():
    first, again, other = (
        record_drive("paper/corridor", "paper", s, replace(SHORT, max_scans=2)) for s in (1, 1, 2)
    )
    assert first.true_poses == again.true_poses
    assert [e for e in first.log if isinstance(e, Pose)] == [e for e in again.log if isinstance(e, Pose)]
    for a, b in zip(first.scans, again.scans, strict=True):
        assert np.array_equal(a.ranges_m, b.ranges_m)
    assert not np.array_equal(first.scans[0].ranges_m, other.scans[0].ranges_m)


@pytest.mark.parametrize("world", ["paper/rooms", "paper/loop", "generated/office-3"])
def test_joined_walls_are_as_long_as_the_walls_and_none_goes_on_straight_in_another(world):
    walls = straight_walls(load_world(world))
    segments, ends = [Segment(*wall) for wall in walls], walls.reshape(-1, 2)
    for i, a in enumerate(segments):
        for j, b in enumerate(segments):
            touch = min(np.hypot(*(p - q)) for p in ends[2 * i : 2 * i + 2] for q in ends[2 * j : 2 * j + 2])
            parallel = abs(math.sin(a.direction - b.direction)) < 1e-3
            assert i == j or touch > 0.002 or not parallel


def test_a_wall_cut_at_a_junction_is_one_wall():
    rows = [[0, 0, 2, 0], [2, 0, 5, 0], [2, 0, 2, 1], [0, 3, 5, 3]]
    world = World("t", "", np.array(rows, dtype=float), np.zeros(4), np.zeros((0, 3)), Pose(1, 1, 0), False)
    lengths = sorted(round(Segment(*row).length, 6) for row in straight_walls(world))
    assert lengths == [1.0, 5.0, 5.0]


def test_a_feature_is_of_the_wall_it_lies_on_and_one_on_no_wall_of_none():
    walls = np.array([[0.0, 0.0, 4.0, 0.0], [0.0, 0.3, 4.0, 0.3]])
    pose = Pose(2.0, 1.3, 0.7)

    def of(bearing, distance, x=2.0):
        feature = seen(bearing - pose.heading, distance)
        return true_walls(replace(pose, x=x), [feature], 0.0, walls, OracleConfig())[0]

    down = -math.pi / 2
    assert of(down, 1.3) == 0 and of(down, 1.0) == 1
    assert of(down, 1.15) is None, "half-way between two walls"
    assert of(down + math.radians(20), 1.0) is None, "not along the normal"
    assert of(down, 1.0, x=4.2) is None, "beyond the end"
    edge = seen(down - pose.heading, 1.0, FeatureKind.EDGE)
    assert true_walls(pose, [edge], 0.0, walls, OracleConfig()) == (None,)


def test_the_smear_of_a_scan_is_taken_out_before_the_wall_is_looked_for():
    walls = np.array([[0.0, 0.0, 4.0, 0.0]])
    feature = seen(-math.pi / 2 - math.radians(9), 1.0, sweep_rad=5.5)
    pose, smear = Pose(2.0, 1.0, 0.0), math.radians(9) / 5.5
    assert true_walls(pose, [feature], 0.0, walls, OracleConfig()) == (None,)
    assert true_walls(pose, [feature], smear, walls, OracleConfig()) == (0,)
