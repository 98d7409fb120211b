# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Rows of the Jacobian are derivatives, made anew where they must be, and no step by them leads uphill."""

import math
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
