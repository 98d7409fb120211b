# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Drives about a room of four walls and four pillars, as a smoother hears them."""

import math
from dataclasses import replace

import numpy as np

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam.motion import MotionSum, RandomWalk
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig
from sonar_explore.slam.turn.sighting import Sighting

WALK = RandomWalk(math.radians(1.5), math.radians(0.7), 0.03)
WHEELS = (0.007, math.radians(1.0))
START = Pose(0.5, 0.5, 0.0)
WALLS = ((math.pi, 0.0), (0.0, 4.0), (-math.pi / 2, 0.0), (math.pi / 2, 3.0))
"""Bearing of each wall's outward normal, and its distance from the origin along it."""


def loop(turn_error=0.0, rounds=2):
    """True poses about a room of 4 m x 3 m and the odometry from each to the next."""
    poses, motions, sums = [START], [], MotionSum(WALK)
    for leg in (3.0, 2.0) * 2 * rounds:
        for k in range(int(leg)):
            turn = 0.5 * math.pi * (k == int(leg) - 1)
            odometry = Pose(0.0, 0.0, 0.0)
            sums.clear(math.tau / (1.0 + turn_error))
            for forward, spin in ((0.0, math.tau), (1.0, 0.0), (0.0, turn)):
                after = odometry @ Pose(forward, 0.0, spin / (1.0 + turn_error))
                sums.add(odometry, after)
                odometry = after
            motions.append(sums.total)
            poses.append(poses[-1] @ Pose(1.0, 0.0, math.tau + turn))
    return poses, motions


def sightings(poses, chain_of=lambda scan, wall: wall):
    """Exact bearings and ranges of every wall in reach."""
    for i, p in enumerate(poses):
        for wall, (normal, distance) in enumerate(WALLS):
            range_m = distance - p.x * math.cos(normal) - p.y * math.sin(normal)
            if range_m < 2.2:
                yield Sighting(i, chain_of(i, wall), wrap_angle(normal - p.heading), 0.0, range_m)


def smoother(poses, motions, rng, off=(0.0, 0.0, 0.0), chain_of=lambda scan, wall: wall):
    out = Smoother(START, SmoothingConfig(), WHEELS)
    by_scan = list(sightings(poses, chain_of))
    for i, p in enumerate(poses):
        dx, dy, dh = rng.normal(0, off) if i else (0.0, 0.0, 0.0)
        out.add_scan(Pose(p.x + dx, p.y + dy, p.heading + dh), motions[i - 1] if i else None)
        for s in by_scan:
            if s.scan == i:
                out.add_sighting(s)
    return out


def noisy(motion, rng):
    """As odometry may measure it."""
    return replace(motion, change=motion.change + rng.multivariate_normal(np.zeros(3), motion.covariance))


def off_by(out, poses):
    true = np.array([(p.x, p.y, p.heading) for p in poses])
    return np.abs(out.poses - true).max(axis=0)


PILLARS = ((1.2, 2.1), (3.4, 0.9), (2.2, 1.6), (3.1, 2.4))


def pillars_seen(i, pose):
    """Exact bearings and ranges of what is in reach."""
    for number, (x, y) in enumerate(PILLARS):
        range_m = math.hypot(x - pose.x, y - pose.y)
        if range_m < 2.2:
            bearing = wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.heading)
            yield Sighting(i, 10 + number, bearing, 0.0, range_m)


def all_pillars_heard(split=0):
    """A smoother that heard the pillars all the way, under other numbers, by `split` more, in the second half."""
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(s._replace(what=s.what + split * (i > len(poses) // 2)))
    for _ in range(4):
        out.solve()
    return out
