# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""`chain` with its joint estimate, on recorded drives; nothing is moved in retrospect."""

from dataclasses import replace

import numpy as np
import pytest

from sonar_explore.geometry import Pose
from sonar_explore.slam import ChainSlam, SlamConfig, make_slam
from sonar_explore.slam.joint.joint import JointSlam
from sonar_explore.slam.joint.landmarks import CHAIN, KIND, LINE
from sonar_explore.studies.compare.drives import record_drive

ROBUST = SlamConfig.robust()
WITHOUT = replace(ROBUST, joint=replace(ROBUST.joint, enabled=False))


@pytest.fixture(scope="module")
def drive():
    return record_drive("paper/loop", seed=300)


def played(drive, config):
    """The SLAM after the drive, the poses as they were first believed, and its updates."""
    slam, first, updates = make_slam("chain", drive.world.start, config), [], []
    for entry in drive.log:
        if isinstance(entry, Pose):
            slam.predict(entry)
        else:
            updates.append(slam.update(entry))
            first.append(updates[-1].pose)
    return slam, first, updates


def off(drive, poses):
    """Distance to the truth, mean, [m]."""
    return np.mean([true.distance_to(pose) for true, pose in zip(drive.true_poses, poses, strict=True)])


def test_round_loops_one_estimate_of_all_is_nearer_to_the_truth(drive):
    drives = [drive, *(record_drive("paper/loop", seed=seed) for seed in (301, 302))]
    joint, alone = (
        np.mean([off(one, played(one, config)[1]) for one in drives]) for config in (ROBUST, WITHOUT)
    )
    assert joint < 0.8 * alone


def test_no_pose_and_no_link_is_moved_afterwards(drive):
    slam, first, _ = played(drive, ROBUST)
    assert [entry.pose for entry in slam.scans] == first
    for chain in slam.chains.chains:
        for link in chain.links:
            assert link.segment == link.feature.segment.transformed(first[link.scan])


def test_the_filter_keeps_the_chains_that_there_are(drive):
    slam, _, updates = played(drive, ROBUST)
    assert isinstance(slam, JointSlam)
    marks = slam._filter.landmarks
    assert set(marks[marks[:, KIND] == LINE, CHAIN].astype(int)) == {chain.id for chain in slam.chains.chains}
    assert any(update.merges for update in updates)


@pytest.mark.parametrize(
    "config",
    [
        WITHOUT,
        replace(ROBUST, odometry=replace(ROBUST.odometry, enabled=False)),
        replace(ROBUST, reference=replace(ROBUST.reference, refined=False)),
        SlamConfig(),
    ],
)
def test_without_odometry_or_refined_lines_there_is_no_joint_estimate(config):
    assert type(make_slam("chain", Pose(0.0, 0.0, 0.0), config)) is ChainSlam
