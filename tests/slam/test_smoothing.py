# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Everything measured, solved at once: exact measurements give the truth, false ones do little harm."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam import jacobian, make_slam
from sonar_explore.slam.factor_graph import FactorGraph, FactorKind
from sonar_explore.slam.motion import MotionSum, RandomWalk, told_by_odometry
from sonar_explore.slam.sighting import Sighting
from sonar_explore.slam.smoothing import Smoother, SmoothingConfig

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


def covariance(out, chain, at, normal):
    return out.covariances([chain], at, normal[None])[0]


def off_by(out, poses):
    true = np.array([(p.x, p.y, p.heading) for p in poses])
    return np.abs(out.poses - true).max(axis=0)


@pytest.mark.parametrize("seed", range(4))
def test_exact_measurements_give_the_true_poses_from_bad_first_guesses(seed):
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(seed), off=(0.08, 0.08, 0.04))
    for _ in range(5):
        out.solve()
    assert (off_by(out, poses) < 1e-4).all()
    assert np.abs(out.constants).max() < 1e-5


def test_a_wrong_wheel_base_is_found_by_the_turns():
    poses, motions = loop(turn_error=0.01)
    out = smoother(poses, motions, np.random.default_rng(0), off=(0.03, 0.03, 0.02))
    for _ in range(5):
        out.solve()
    assert out.constants[0] == pytest.approx(0.01, abs=0.002)
    assert (off_by(out, poses) < (0.01, 0.01, 0.005)).all()


@pytest.mark.parametrize("scale", [0.01, -0.01])
def test_the_scale_of_the_ranges_is_learned_from_walls_near_and_far_more_with_every_round(scale):
    found = []
    for rounds in (2, 8, 20):
        poses, motions = loop(rounds=rounds)
        out = Smoother(START, SmoothingConfig(range_m=0.003), WHEELS)
        for i, p in enumerate(poses):
            out.add_scan(p, motions[i - 1] if i else None)
        for s in sightings(poses):
            out.add_sighting(replace(s, range_m=s.range_m / (1.0 + scale)))
        for _ in range(5):
            out.solve()
        found.append(out.constants[2] / scale)
    assert 0.2 < found[0] < found[1] < found[2] < 1.0
    assert found[2] > 0.75


def odometry_plainly(motion):
    """What whitens it, the change, and its derivatives by the wheels and by the own turn."""
    white = np.linalg.inv(np.linalg.cholesky(motion.covariance))[np.tril_indices(3)]
    return white, motion.change, motion.by_wheels.ravel(), motion.by_own


def test_a_motion_is_whitened_by_the_inverse_root_of_its_covariance():
    for motion in loop(rounds=1)[1]:
        measured, (change, by_wheels, by_own, covariance) = np.zeros(18), motion.as_arrays()
        told_by_odometry(change, by_wheels, by_own, covariance, measured)
        np.testing.assert_allclose(measured, np.concatenate(odometry_plainly(motion)), rtol=1e-9, atol=1e-12)


def one_of_each():
    """A graph with a factor of every kind, of nothing in particular."""
    rng, graph = np.random.default_rng(3), FactorGraph()
    graph.add_variable(*rng.normal(0, 0.01, 3))
    here, there = (graph.add_variable(*rng.normal(0, 2.0, 3), rng.normal(0, 0.01)) for _ in range(2))
    line, point = (graph.add_variable(*rng.normal(0, 2.0, 2)) for _ in range(2))
    column = graph.add_variable(*rng.normal(0, 2.0, 2), 0.2)
    motion = loop(rounds=1)[1][0]
    parts = odometry_plainly(motion)
    graph.add_factor(FactorKind.START, here, -1, (0.5, 0.5, 0.0))
    graph.add_factor(FactorKind.ROBOT, here, -1, (100.0, 50.0, 200.0))
    graph.add_factor(FactorKind.TURN, there, -1, (250.0, 0.01, 300.0))
    graph.add_factor(FactorKind.ODOMETRY, here, there, np.concatenate(parts).tolist())
    for kind, what in ((FactorKind.LINE, line), (FactorKind.POINT, point), (FactorKind.COLUMN, column)):
        for scan in (here, there):
            graph.add_factor(kind, scan, what, (*rng.uniform(0.3, 2.0, 3), 30.0, 70.0))
    graph.add_factor(FactorKind.RADIUS, column, -1, (0.1, 25.0))
    return graph


def slope_and_loss(graph, f):
    """Of one factor, its loss robust where it is heard and else the sum of squares."""
    slope, touched = np.empty((graph.variables, 4)), np.zeros(graph.variables, dtype=bool)
    one = slice(f, f + 1)
    problem = graph.kinds[one], graph.ends[one], graph.measured[one], graph.values
    off, rows = np.empty(3), np.zeros((1, 3, 11))
    heard, total = jacobian.linearised(*problem, False, 0.0, rows, np.empty((3, 11)), off, slope, touched)
    assert total == pytest.approx(heard or off @ off)
    return slope, total


def test_the_slope_of_every_kind_of_factor_agrees_with_finite_differences_of_its_loss():
    graph = one_of_each()
    for f in range(graph.factors):
        exact, _ = slope_and_loss(graph, f)
        for k, variable in enumerate(graph.values):
            for i in range(graph.dims[k]):
                found = []
                for step in (1e-6, -2e-6, 1e-6):
                    variable[i] += step
                    found.append(slope_and_loss(graph, f)[1])
                assert exact[k, i] == pytest.approx((found[0] - found[1]) / 4e-6, abs=2.0, rel=1e-4)


def linearised(graph, tolerance, *, huber=False):
    slope, touched = np.empty((graph.variables, 4)), np.zeros(graph.variables, dtype=bool)
    problem = graph.kinds, graph.ends, graph.measured, graph.values
    jacobian.linearised(
        *problem, huber, tolerance, graph.rows, np.empty((3, 11)), np.empty(3), slope, touched
    )
    return slope, touched


@pytest.mark.parametrize("seed", range(6))
def test_no_solution_fits_worse_than_what_it_begins_with_however_far_off_that_is(seed):
    rng = np.random.default_rng(seed)
    poses, motions = loop()
    out = smoother(poses, motions, rng)
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(s)
    out.solve()
    graph = out._graph
    graph.values[out._scans[1:], :3] += rng.normal(0.0, (1.0, 1.0, 0.6), (len(poses) - 1, 3))
    out._config = replace(out._config, iterations=1)
    totals = [total(graph)]
    for _ in range(4):
        out.solve()
        totals.append(total(graph))
    assert all(after <= before + 0.1 for before, after in pairwise(totals))
    assert np.isfinite(graph.values).all()


def total(graph):
    """By the loss of the last steps, Cauchy's."""
    slope, touched = np.empty((graph.variables, 4)), np.zeros(graph.variables, dtype=bool)
    problem = graph.kinds, graph.ends, graph.measured, graph.values
    rows = np.zeros_like(graph.rows)
    return jacobian.linearised(*problem, False, 0.0, rows, np.empty((3, 11)), np.empty(3), slope, touched)[1]


def test_the_slope_is_exact_and_rows_are_renewed_only_where_they_changed_or_resist_a_motion_of_all():
    graph = one_of_each()
    _, touched = linearised(graph, 0.2)
    assert touched.all()
    before = graph.rows.copy()
    slope, touched = linearised(graph, 0.2)
    assert not touched.any() and (graph.rows == before).all()
    graph.values[5, :2] += 0.002  # the column
    moved, touched = linearised(graph, 0.2)
    assert (moved[5] != slope[5]).any()
    slope, touched = linearised(graph, 1e-6)
    assert touched[5] and not touched[[3, 4]].any()
    np.testing.assert_array_equal(moved, slope)


@pytest.mark.parametrize(("angle", "renewed"), [(0.001, False), (0.3, True)])
def test_factors_that_would_resist_a_turn_of_the_whole_map_are_renewed(angle, renewed):
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(s)
    out.solve()
    graph, (c, s) = out._graph, (math.cos(angle), math.sin(angle))
    for k, variable in enumerate(graph.values):
        if k in out._chains.values():
            variable[0] += angle
        elif k:
            variable[:2] = variable[:2] @ [[c, s], [-s, c]]
            variable[2] += angle if k in out._scans else 0.0
    _, touched = linearised(graph, 1e9)
    assert touched.all() if renewed else not touched.any()


PILLARS = ((1.2, 2.1), (3.4, 0.9), (2.2, 1.6), (3.1, 2.4))


def pillars_seen(i, pose):
    """Exact bearings and ranges of what is in reach."""
    for number, (x, y) in enumerate(PILLARS):
        range_m = math.hypot(x - pose.x, y - pose.y)
        if range_m < 2.2:
            bearing = wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.heading)
            yield Sighting(i, 10 + number, bearing, 0.0, range_m)


@pytest.mark.parametrize("seed", range(3))
def test_points_alone_give_the_true_poses_from_bad_first_guesses(seed):
    poses, motions = loop()
    rng, out = np.random.default_rng(seed), Smoother(START, SmoothingConfig(), WHEELS)
    for i, p in enumerate(poses):
        dx, dy, dh = rng.normal(0, (0.05, 0.05, 0.03)) if i else (0.0, 0.0, 0.0)
        out.add_scan(Pose(p.x + dx, p.y + dy, p.heading + dh), motions[i - 1] if i else None)
        for s in pillars_seen(i, p):
            out.add_point(s)
    for _ in range(6):
        out.solve()
    assert (off_by(out, poses) < 1e-4).all()
    numbers, places = out.points()
    assert dict(zip(numbers.tolist(), places.round(3).tolist(), strict=True)) == {
        10 + k: list(place) for k, place in enumerate(PILLARS)
    }


def test_a_column_heard_from_all_sides_is_known_by_its_middle_and_radius():
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        away = math.hypot(2.5 - p.x, 1.5 - p.y)
        bearing = wrap_angle(math.atan2(1.5 - p.y, 2.5 - p.x) - p.heading)
        out.add_point(Sighting(i, 7, bearing, 0.0, away - 0.12, radius_m=0.12 * (1.3 if i % 2 else 0.9)))
    for _ in range(5):
        out.solve()
    (number,), ((x, y),) = out.points()
    assert number == 7
    assert (x, y) == pytest.approx((2.5, 1.5), abs=1e-3)
    assert out.radii == pytest.approx([0.12], abs=2e-3)
    assert (off_by(out, poses) < 1e-3).all()


def test_a_point_heard_once_binds_nothing_and_stays_where_its_scan_heard_it():
    poses, motions = loop(rounds=1)
    out = smoother(poses, motions, np.random.default_rng(0))
    out.solve()
    before = out.poses.copy()
    out.add_point(Sighting(3, 7, 0.4, 0.0, 1.0))
    out.solve()
    np.testing.assert_allclose(out.poses, before, atol=1e-9)
    (number,), ((x, y),) = out.points()
    assert number == 7
    assert (x, y) == pytest.approx(
        (poses[3] @ Pose(0.0, 0.0, 0.4)).transform(np.array([[1.0, 0.0]]))[0], abs=1e-6
    )


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
                out.add_point(replace(s, bearing_rad=bearing, range_m=range_m))
        out.add_point(Sighting(4, 99, math.atan2(lonely[1], lonely[0]), 0.0, float(np.hypot(*lonely))))
        for _ in range(2):
            out.solve()
        numbers, places = out.points()
        place, last = places[numbers == number], Pose(*map(float, out.poses[-1]))
        off.append(last.inverse().transform(place)[0])
        said.append(out.spread(np.array([number]), place)[0])
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
        rows, variance = out.near(np.array(here), 1.1, (numbers, places))
        away = np.hypot(*(places[:, None] - np.array(here)[None]).transpose(2, 0, 1)).min(axis=1)
        assert rows.tolist() == np.flatnonzero(away <= 1.1).tolist()
        spread = out.spread(numbers[rows], places[rows])
        np.testing.assert_allclose(variance, 0.5 * np.trace(spread, axis1=1, axis2=2))
    assert numbers.tolist() == [10, 11, 12, 13, 99]


def test_a_planted_false_merge_does_not_fold_the_map():
    poses, motions = loop()

    def chain_of(scan, wall):  # the last round meets another chain on the far wall
        return 9 if wall == 1 and scan > len(poses) // 2 else wall

    out = smoother(poses, motions, np.random.default_rng(0), chain_of=chain_of)
    stranger = [Sighting(k, 5, wrap_angle(-poses[k].heading), 0.0, 3.7 - poses[k].x) for k in (2, 3)]
    for s in stranger:  # a cupboard 0.3 m before the wall
        out.add_sighting(s)
    out.solve()
    assert (off_by(out, poses) < 1e-6).all()
    out.merge(1, 9)
    out.merge(1, 5)
    for _ in range(3):
        out.solve()
    assert (off_by(out, poses) < (0.03, 0.03, 0.02)).all()


def test_two_numbers_of_one_column_become_one_and_say_together_what_one_would():
    poses, motions = loop()
    found = []
    for split in (False, True):
        out = smoother(poses, motions, np.random.default_rng(0))
        for i, p in enumerate(poses):
            for s in pillars_seen(i, p):
                number = s.what + 50 * (split and i > len(poses) // 2)
                out.add_point(replace(s, what=number, range_m=s.range_m - 0.1, radius_m=0.08))
        for number in range(10, 14) if split else ():
            out.merge_points(number, number + 50)
        for _ in range(5):
            out.solve()
        numbers, places = out.points()
        assert sorted(numbers.tolist()) == [10, 11, 12, 13] and len(out.radii) == 4
        found.append((out.poses, places[np.argsort(numbers)]))
    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-6)
    np.testing.assert_allclose(found[0][1], found[1][1], atol=1e-6)
    np.testing.assert_allclose(found[1][1], PILLARS, atol=2e-3)


def test_a_planted_false_merge_of_points_does_not_fold_the_map():
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(s)
    out.solve()
    out.merge_points(10, 12)  # more than a metre apart
    for _ in range(3):
        out.solve()
    assert (off_by(out, poses) < (0.03, 0.03, 0.02)).all()


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


def test_a_true_merge_puts_two_chains_on_one_line_and_moves_nothing():
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0), chain_of=lambda i, w: w + 4 * (i > 9))
    for wall in range(4):
        out.merge(wall, wall + 4)
    out.solve()
    assert (off_by(out, poses) < 1e-6).all()
    assert out.chains == [0, 1, 2, 3]


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
            out.add_sighting(replace(s, bearing_rad=bearing, range_m=rng.normal(s.range_m, config.range_m)))
        out.solve()
        (x, y, heading), (angle, distance) = out.poses[-1], out.line(1)
        there = Pose(x, y, heading) @ Pose(0.8, 0.3, 0.0)
        along = there.x * math.cos(angle) + there.y * math.sin(angle) - distance
        off.append([wrap_angle(heading - poses[-1].heading - angle), along - (ahead.x - 4.0)])
    expected, found = covariance(out, 1, ahead, normal), np.cov(np.transpose(off))
    assert np.sqrt(np.diag(found)) == pytest.approx(np.sqrt(np.diag(expected)), rel=0.35)
    correlation = [m[0, 1] / math.sqrt(m[0, 0] * m[1, 1]) for m in (expected, found)]
    assert correlation[1] == pytest.approx(correlation[0], abs=0.3)


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


def all_pillars_heard(split=0):
    """A smoother that heard the pillars all the way, under other numbers, by `split` more, in the second half."""
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(replace(s, what=s.what + split * (i > len(poses) // 2)))
    for _ in range(4):
        out.solve()
    return out


def test_putting_points_together_costs_nothing_where_they_are_the_same_and_much_where_they_are_not():
    out = all_pillars_heard(split=50)
    before, false = out.misfit(), out.copy()
    for number in range(10, 14):
        out.merge_points(number, number + 50)
    out.solve()
    assert out.misfit() == pytest.approx(before, abs=1.0)
    false.merge_points(10, 62)
    false.solve()
    assert false.misfit() > before + 25.0


def test_a_copy_stays_as_it_was_whatever_becomes_of_the_other():
    out, other = all_pillars_heard(), all_pillars_heard()
    kept = out.copy()
    out.merge_points(10, 12)
    out.merge(0, 2)
    out.add_scan(Pose(1.0, 1.0, 0.0), loop()[1][0])
    out.add_point(Sighting(0, 99, 0.4, 0.0, 1.0))
    out.solve()
    for one in (kept, other):
        one.solve()
    assert (kept.poses == other.poses).all() and (kept.points()[1] == other.points()[1]).all()
    assert kept.misfit() == other.misfit() != out.misfit()
