# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What is solved bit by bit, after each scan, is what all factors together say."""

from dataclasses import replace

import numpy as np
import pytest
from a_room import START, WHEELS, loop, noisy, pillars_seen, sightings

from sonar_explore.geometry import Pose
from sonar_explore.slam.smoothing import jacobian
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig


def growing(seed, off=(0.05, 0.05, 0.02), **config):
    """A smoother that hears a loop of a room, not solved yet, after every scan."""
    poses, motions = loop(turn_error=0.01)
    rng = np.random.default_rng(seed)
    out = Smoother(START, replace(SmoothingConfig(), **config), WHEELS)
    seen = [*sightings(poses)]
    for i, p in enumerate(poses):
        guess = Pose(*(np.array(p.as_row()) + rng.normal(0.0, off)).tolist())
        out.add_scan(guess, noisy(motions[i - 1], rng) if i else None)
        for s in seen:
            if s.scan == i:
                out.add_sighting(s._replace(range_m=s.range_m + rng.normal(0.0, 0.01)))
        for s in pillars_seen(i, p):
            out.add_point(s)
        yield out


def solved(seed, **config):
    """After each scan."""
    for out in growing(seed, **config):
        out.solve()
    return out


def normal_equations(graph, rows, off):
    """J'J and J'r over all numbers that the variables have, and which of the four of each they are."""
    all_rows = np.zeros((graph.factors, 3, graph.variables, 4))
    for f, (first, second) in enumerate(graph.ends):
        all_rows[f, :, first] = rows[f, :, :4]
        if second >= 0:
            all_rows[f, :, second] = rows[f, :, 4:8]
        all_rows[f, :, 0, :3] += rows[f, :, 8:]
    used = np.arange(4) < graph.dims[:, None]
    by = all_rows.reshape(3 * graph.factors, -1)[:, used.ravel()]
    return by.T @ by, by.T @ off.ravel(), used


def batch(graph, steps=30):
    """The values where Gauss-Newton over all factors stands still, each step linearised at the last one's values."""
    values = graph.values.copy()
    for _ in range(steps):
        rows, off = np.zeros_like(graph.rows), np.zeros_like(graph.off)
        all_of_them = np.ones(graph.variables, dtype=bool)
        problem = graph.kinds, graph.ends, graph.measured, values
        jacobian.linearised(*problem, False, 0, all_of_them, rows, off, np.zeros((3, 4)), all_of_them.copy())
        normal, right, used = normal_equations(graph, rows, off)
        step = np.linalg.solve(normal, right)
        values[used] -= step
        if np.abs(step).max() < 1e-9:
            return values
    raise AssertionError("does not stand still")


@pytest.mark.parametrize("seed", range(4))
def test_the_solution_grown_scan_by_scan_is_that_of_all_factors_at_once(seed):
    out = solved(seed)
    apart = np.abs(batch(out._graph)[out._scans, :3] - out.poses).max(axis=0)
    assert (apart < (5e-3, 5e-3, 2e-3)).all()


@pytest.mark.parametrize("seed", range(4))
def test_what_stays_linearised_where_it_was_changes_the_solution_by_less_than_a_millimetre(seed):
    often = solved(seed, anchored_m=0.0, anchored_rad=0.0, anchored_scale=0.0)
    seldom = solved(seed)
    assert (seldom._graph.anchors != seldom._graph.values).any()
    assert np.abs(often.poses[:, :2] - seldom.poses[:, :2]).max() < 1e-3
    assert seldom.misfit() == pytest.approx(often.misfit(), rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_rows_and_their_factor_agree_after_every_scan_even_where_the_steps_run_out(seed):
    """Rows made anew and not eliminated would be of another problem than the factor, which the next steps go by."""
    for out in growing(seed, off=(0.6, 0.6, 0.4), iterations=1):
        out.solve()
        graph = out._graph
        normal, _, used = normal_equations(graph, graph.rows, graph.off)
        first, last = int(out._scans[0]), int(out._scans[-1])
        by_last, by_first = np.zeros((1, 4, 4)), np.zeros((1, 4, 4))
        by_last[0], by_first[0] = np.eye(4), -np.eye(4)
        found = out._elimination.covariances(np.array([last]), by_last, first, by_first)[0]
        index = np.cumsum(used.ravel()).reshape(used.shape) - 1
        pick = np.zeros((4, len(normal)))
        pick[range(4), index[last]] += 1.0
        pick[range(4), index[first]] -= 1.0
        expected = pick @ np.linalg.solve(normal, pick.T)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-9)
        assert np.isfinite(graph.values).all()
