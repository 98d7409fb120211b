# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""How far off a SLAM was: nothing for the truth, and what a rigid motion takes away."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.geometry import Pose
from sonar_explore.studies.compare.accuracy import accuracy, aligned_error, replay, revisit_gap
from sonar_explore.studies.compare.drives import record_drive
from sonar_explore.studies.compare.jobs import REPLAYED
from sonar_explore.studies.compare.oracle import lines_of, oracle

CONFIG = ExplorationConfig(max_scans=8).with_noise("paper")


@pytest.fixture(scope="module")
def recorded():
    drive = record_drive("paper/corridor", "paper", seed=2, config=CONFIG)
    truth = oracle(drive, noise_preset("paper"), CONFIG.slam.features, CONFIG.slam.agreement)
    return drive, truth, Scorer(drive.world)


def test_the_true_poses_are_not_off_at_all(recorded):
    drive, truth, scorer = recorded
    found = accuracy(drive, drive.true_poses, truth.features, scorer, CONFIG, (0, 0), 0.0)
    assert found.position_error_m.max == found.heading_error_deg.max == 0.0
    assert found.aligned_error_m < 1e-9
    assert found.wall_error_m is not None and found.wall_error_m < 0.06


def test_a_shift_of_all_poses_is_an_error_of_the_trajectory_and_of_the_walls_but_not_of_its_shape(recorded):
    drive, truth, scorer = recorded
    shifted = [Pose(p.x, p.y + 0.3, p.heading) for p in drive.true_poses]
    found = accuracy(drive, shifted, truth.features, scorer, CONFIG, (0, 0), 0.0)
    assert found.position_error_m.mean == pytest.approx(0.3)
    assert found.aligned_error_m < 1e-9
    assert found.wall_error_m is not None and found.wall_error_m > 0.1


def test_full_turns_are_no_error_of_the_heading(recorded):
    drive, truth, scorer = recorded
    turned = [Pose(p.x, p.y, p.heading + math.tau) for p in drive.true_poses]
    found = accuracy(drive, turned, truth.features, scorer, CONFIG, (0, 0), 0.0)
    assert found.heading_error_deg.max < 1e-6


@pytest.mark.parametrize("name", REPLAYED)
def test_a_replay_gives_the_same_poses_again_and_scores_every_scan(recorded, name):
    drive, truth, scorer = recorded
    first, again = (replay(drive, name, truth, scorer, CONFIG) for _ in range(2))
    assert first.poses == again.poses and len(first.poses) == len(drive.true_poses)
    assert 0 <= first.false_associations <= first.associations
    assert (first.associations > 0) == (name in ("literal", "chain", "smoothed"))


@given(st.floats(-math.pi, math.pi), st.floats(-5, 5), st.floats(-5, 5), st.integers(0, 2**32 - 1))
def test_alignment_takes_any_rigid_motion_away_and_never_makes_worse(angle, x, y, seed):
    rng = np.random.default_rng(seed)
    true = rng.uniform(-3, 3, (12, 2))
    moved = Pose(x, y, angle).transform(true)
    assert aligned_error(moved, true) < 1e-9
    noisy = true + rng.normal(0, 0.1, true.shape)
    root_mean_square = math.sqrt(((noisy - true) ** 2).sum(axis=1).mean())
    assert aligned_error(noisy, true) <= root_mean_square + 1e-12


def test_the_gap_is_what_two_visits_of_a_place_disagree_by():
    there_and_back = np.column_stack(
        [np.concatenate([np.arange(0, 10.0), np.arange(9, -1.0, -1)]), np.zeros(20)]
    )
    assert revisit_gap(there_and_back, there_and_back) == 0.0
    drifted = there_and_back + [(0.0, 0.2 * (i >= 10)) for i in range(20)]
    assert revisit_gap(drifted, there_and_back) == pytest.approx(0.2)
    assert revisit_gap(there_and_back[:10], there_and_back[:10]) is None


def test_walls_either_side_of_a_door_lie_on_one_line_and_parallel_ones_do_not():
    walls = np.array([[0, 1, 2, 1], [3, 1, 5, 1], [0, 1.15, 2, 1.15], [2, 1, 2, 4]], dtype=float)
    first, beyond_door, behind, across = lines_of(walls)
    assert first == beyond_door
    assert len({first, behind, across}) == 3
