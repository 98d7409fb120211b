# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Rows of the Jacobian are derivatives, made anew where they must be, and no step by them leads uphill."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from a_room import loop, pillars_seen, smoother

from sonar_explore.slam.motion import told_by_odometry
from sonar_explore.slam.smoothing import jacobian
from sonar_explore.slam.smoothing.factor_graph import FactorGraph, FactorKind


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


def linearised(graph, stale=(), *, huber=False, known=0):
    """Which variables were touched."""
    touched, old = np.zeros((2, graph.variables), dtype=bool)
    old[list(stale)] = True
    problem = graph.kinds, graph.ends, graph.measured, graph.anchors
    jacobian.linearised(*problem, huber, known, old, graph.rows, graph.off, graph.shared, touched)
    return touched


def losses(graph, *, huber=False, only=slice(None)):
    problem = graph.kinds[only], graph.ends[only], graph.measured[only], graph.values
    return jacobian.losses(*problem, huber, np.empty((3, 11)), np.empty(3))


def slope(graph, f):
    """Of one factor, at the anchors, shape (variables, 4)."""
    out, by = np.zeros((graph.variables, 4)), graph.off[f] @ graph.rows[f]
    first, second = graph.ends[f]
    out[first] += by[:4]
    if second >= 0:
        out[second] += by[4:8]
    out[0, :3] += by[8:]
    return out


def test_the_slope_of_every_kind_of_factor_agrees_with_finite_differences_of_its_loss():
    graph = one_of_each()
    linearised(graph)
    for f in range(graph.factors):
        exact = slope(graph, f)
        for k, variable in enumerate(graph.values):
            for i in range(graph.dims[k]):
                found = []
                for step in (1e-6, -2e-6, 1e-6):
                    variable[i] += step
                    found.append(losses(graph, only=slice(f, f + 1))[1])
                assert exact[k, i] == pytest.approx((found[0] - found[1]) / 4e-6, abs=2.0, rel=1e-4)


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
    totals = [losses(graph)[1]]
    for _ in range(4):
        out.solve()
        totals.append(losses(graph)[1])
    assert all(after <= before + 0.1 for before, after in pairwise(totals))
    assert np.isfinite(graph.values).all()


def test_only_what_is_new_and_what_was_heard_of_stale_variables_is_linearised_anew():
    graph = one_of_each()
    assert linearised(graph).all()
    before = graph.rows.copy(), graph.off.copy()
    graph.anchors[5, :2] += 0.002  # the column
    assert not linearised(graph, known=graph.factors).any()
    assert (graph.rows == before[0]).all() and (graph.off == before[1]).all()
    touched = linearised(graph, [5], known=graph.factors)
    assert touched.tolist() == [True, True, True, False, False, True]
    partly = graph.rows.copy(), graph.off.copy()
    assert linearised(graph, known=graph.factors - 1).tolist() == [True, *[False] * 4, True]
    kept = graph.shared.copy()
    linearised(graph)
    assert (graph.rows == partly[0]).all() and (graph.off == partly[1]).all()
    by, off = graph.rows[:, :, 8:].reshape(-1, 3), graph.off.ravel()
    for shared in (kept, graph.shared):
        np.testing.assert_allclose(shared, np.column_stack([by.T @ by, by.T @ off]), rtol=1e-12)


@pytest.mark.parametrize("angle", [0.001, 0.3])
def test_rows_at_the_anchors_say_nothing_of_how_the_whole_map_lies(angle):
    """Whichever variables have new anchors: the derivatives by a turn of all anchors about the origin vanish."""
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(s)
    out.solve()
    graph, lines = out._graph, [*out._chains.values()]
    moved = np.arange(graph.variables) % 3 == 1
    graph.anchors[moved] += np.random.default_rng(1).normal(0.0, angle, (moved.sum(), 4))
    linearised(graph, np.flatnonzero(moved), known=graph.factors)
    x, y = graph.anchors[:, 0].copy(), graph.anchors[:, 1].copy()
    turn = np.column_stack([-y, x, np.ones_like(x), np.zeros_like(x)])
    turn[lines] = 1.0, 0.0, 0.0, 0.0
    turn[graph.dims == 2, 2] = 0.0
    for f, (first, second) in enumerate(graph.ends):
        if second >= 0:
            by_first, by_second = graph.rows[f, :, :4] @ turn[first], graph.rows[f, :, 4:8] @ turn[second]
            np.testing.assert_allclose(by_first, -by_second, atol=1e-8)
