# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Everything measured, solved at once after every scan of a simulated drive."""

import math

import numpy as np
from a_room import START

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam import make_slam


def log_of_a_drive(seed):
    """Twice about a room with a column, steered by the truth: odometry and scans, and the true scan poses."""
    walls = [
        [0, 0, 4, 0],
        [4, 0, 4, 3],
        [4, 3, 0, 3],
        [0, 3, 0, 0],
        [1.5, 1.3, 2.5, 1.3],
        [1.5, 1.7, 2.5, 1.7],
    ]
    world = World("ring", "", np.array(walls, dtype=float), np.zeros(6), np.zeros((0, 3)), START, True)
    robot = Simulator(world, SimulatorConfig(noise=noise_preset("paper")), np.random.default_rng(seed))
    log: list = []
    true = []
    stops = [(2.0, 0.6), (3.4, 0.6), (3.4, 2.4), (2.0, 2.4), (0.6, 2.4), (0.6, 0.6)] * 2
    for i, (x, y) in enumerate(stops):
        true.append(robot.true_pose)
        log.append(robot.scan(-1 if i % 2 else 1))
        for _ in range(300):
            here = robot.true_pose
            error = wrap_angle(math.atan2(y - here.y, x - here.x) - here.heading)
            if math.hypot(x - here.x, y - here.y) < 0.05:
                break
            robot.tick(0.4 if abs(error) < 0.3 else 0.0, float(np.clip(error / 0.04, -0.8, 0.8)))
            log.append(robot.pose_robot_in_odometry)
    return log, true


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
