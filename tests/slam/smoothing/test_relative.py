# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""How unsure lines, points and scans are said to be is how far off they are, drive after drive."""

import math

import numpy as np
import pytest
from a_room import START, WHEELS, all_pillars_heard, loop, noisy, pillars_seen, sightings, smoother
from way_in import way_in

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam.smoothing.known_points import BOUND, STATE, VARIABLE
from sonar_explore.slam.smoothing.relative import near_points, point_covariances
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig
from sonar_explore.slam.turn.sighting import Sighting


def covariance(out, chain, at, normal):
    return out.covariances([chain], at, normal[None])[0]


def spread(out, numbers, at):
    """Covariance of x y of points, seen from the last scan, shape (n, 2, 2)."""
    rows, found = out.known_points.rows[numbers], np.zeros((len(numbers), 2, 2))
    variables, bound = np.ascontiguousarray(rows[:, VARIABLE]), rows[:, STATE] == BOUND
    point_covariances(*[variables, bound, at, *out.solved[1:], found])
    return found


@pytest.mark.parametrize("number", [10, 99])
def test_the_spread_of_a_point_is_that_of_what_many_noisy_drives_say(number):
    rng, (poses, motions) = np.random.default_rng(number), loop(rounds=1)
    config = SmoothingConfig(  # sure of what these drives have no error of
        point_bearing_rad=0.02, point_range_m=0.02, turn_rad=1e-4, range_scale=1e-5
    )
    off, said = [], []
    lonely = poses[4].inverse().transform(np.array([[3.5, 1.5]]))[0]  # number 99: heard by scan 4 alone
    for _ in range(200):
        out = Smoother(START, config, (1e-5, 1e-5))
        for i, p in enumerate(poses):
            out.add_scan(p, noisy(motions[i - 1], rng) if i else None)
            for s in pillars_seen(i, p):
                bearing = s.bearing_rad + rng.normal(0, config.point_bearing_rad)
                range_m = s.range_m + rng.normal(0, config.point_range_m)
                out.add_point(s._replace(bearing_rad=bearing, range_m=range_m))
        out.add_point(Sighting(4, 99, math.atan2(lonely[1], lonely[0]), 0.0, float(np.hypot(*lonely))))
        for _ in range(2):
            out.solve()
        numbers, places = out.points()
        place, last = places[numbers == number], Pose(*map(float, out.poses[-1]))
        off.append(last.inverse().transform(place)[0])
        said.append(spread(out, np.array([number]), place)[0])
    last = poses[-1]
    c, s = math.cos(last.heading), math.sin(last.heading)
    turn = np.array([[c, -s], [s, c]])
    found = turn @ np.cov(np.array(off).T) @ turn.T
    assert np.sqrt(np.diag(np.mean(said, axis=0))) == pytest.approx(np.sqrt(np.diag(found)), rel=0.2)


def test_points_in_reach_are_found_with_how_unsure_they_are_and_no_others():
    out = all_pillars_heard()
    x, y = out.poses[2, :2]
    out.add_point(Sighting(2, 99, 0.4, 0.0, 1.0))
    out.solve()
    for here in ([[x, y]], [[x + 1.0, y], [3.0, 1.0]], [[20.0, 0.0]]):
        numbers, places = out.points()
        rows = np.empty(len(numbers), dtype=np.int64)
        near = np.array(here), 1.1, numbers, places, out.known_points.rows
        variance = way_in(near_points)(*near, *out.solved[1:], rows)
        rows = rows[: len(variance)]
        away = np.hypot(*(places[:, None] - np.array(here)[None]).transpose(2, 0, 1)).min(axis=1)
        assert rows.tolist() == np.flatnonzero(away <= 1.1).tolist()
        unsure = spread(out, numbers[rows], places[rows])
        np.testing.assert_allclose(variance, 0.5 * np.trace(unsure, axis1=1, axis2=2))
    assert numbers.tolist() == [10, 11, 12, 13, 99]


@pytest.mark.parametrize("seed", range(2))
def test_the_drift_since_a_scan_is_that_of_what_many_noisy_drives_say(seed):
    rng, (poses, motions) = np.random.default_rng(seed), loop(rounds=1)
    true, off = poses[2].inverse() @ poses[-1], []
    for _ in range(150):
        out = Smoother(START, SmoothingConfig(turn_rad=1e-4), (1e-5, 1e-5))
        for i, p in enumerate(poses):
            out.add_scan(p, noisy(motions[i - 1], rng) if i else None)
        for _ in range(2):
            out.solve()
        there, last = (Pose(*map(float, out.poses[k])) for k in (2, -1))
        way = there.inverse() @ last
        off.append((way.x - true.x, way.y - true.y, wrap_angle(way.heading - true.heading)))
    c, s = math.cos(poses[2].heading), math.sin(poses[2].heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = np.sqrt(np.diag(turn @ np.cov(np.transpose(off)) @ turn.T))
    assert np.sqrt(np.diag(out.drift(2))) == pytest.approx(found, rel=0.3)
    assert np.abs(out.drift(len(poses) - 1)).max() < 1e-12


def test_the_pose_is_surer_of_a_chain_it_sees_than_of_none():
    poses, motions = loop(rounds=1)
    out = smoother(poses, motions, np.random.default_rng(0))
    down = np.array([0.0, -1.0])
    assert (covariance(out, 0, poses[-1], down) == 0.0).all()  # nothing solved yet
    out.solve()
    seen = covariance(out, 2, poses[-1], down)
    angle, distance = np.sqrt(np.diag(seen))
    assert 0.0 < angle < math.radians(2.0) and 0.0 < distance < 0.03
    far = poses[-1] @ Pose(1.0, 0.0, 0.0)
    out.add_scan(far, motions[0])
    out.solve()
    assert (np.diag(covariance(out, 2, far, down)) > np.diag(seen)).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_covariance_of_a_chain_is_that_of_what_many_noisy_drives_say(seed):
    rng, (poses, motions) = np.random.default_rng(seed), loop(rounds=1)
    config, ahead = SmoothingConfig(), poses[-1] @ Pose(0.8, 0.3, 0.0)
    normal = np.array([1.0, 0.0])
    off = []
    for _ in range(150):
        out = Smoother(START, config, WHEELS)
        for i, p in enumerate(poses):
            out.add_scan(p, noisy(motions[i - 1], rng) if i else None)
        for s in sightings(poses):
            bearing = rng.normal(s.bearing_rad, math.hypot(config.bearing_rad, config.bearing_least_rad))
            out.add_sighting(s._replace(bearing_rad=bearing, range_m=rng.normal(s.range_m, config.range_m)))
        out.solve()
        (x, y, heading), (angle, distance) = out.poses[-1], out.line(1)
        there = Pose(x, y, heading) @ Pose(0.8, 0.3, 0.0)
        along = there.x * math.cos(angle) + there.y * math.sin(angle) - distance
        off.append([wrap_angle(heading - poses[-1].heading - angle), along - (ahead.x - 4.0)])
    expected, found = covariance(out, 1, ahead, normal), np.cov(np.transpose(off))
    assert np.sqrt(np.diag(found)) == pytest.approx(np.sqrt(np.diag(expected)), rel=0.35)
    correlation = [m[0, 1] / math.sqrt(m[0, 0] * m[1, 1]) for m in (expected, found)]
    assert correlation[1] == pytest.approx(correlation[0], abs=0.3)
