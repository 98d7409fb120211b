# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Everything measured, solved at once after every scan of a simulated drive."""

import numpy as np
from a_drive import log_of_a_drive
from a_room import START

from sonar_explore.geometry import Pose
from sonar_explore.slam import make_slam


def final_error(name, log, true):
    slam = make_slam(name, START)
    for entry in log:
        if isinstance(entry, Pose):
            slam.predict(entry)
        else:
            slam.update(entry)
    return np.mean([e.pose.distance_to(t) for e, t in zip(slam.scans, true, strict=True)])


def test_smoothed_ends_nearer_the_truth_than_chain_and_both_than_dead_reckoning():
    logs = [log_of_a_drive(seed) for seed in range(5)]
    smoothed, chain, off = (
        np.mean([final_error(name, *run) for run in logs]) for name in ("smoothed", "chain", "off")
    )
    assert smoothed < chain < off
