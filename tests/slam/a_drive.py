# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A simulated drive about a room, as a SLAM is fed with it."""

import math

import numpy as np
from a_room import START

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import wrap_angle


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
