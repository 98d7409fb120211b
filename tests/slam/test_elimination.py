# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Factors of a problem that grows and shrinks solve it, in whatever order they eliminate its unknowns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.slam import elimination
from sonar_explore.slam.elimination import Elimination


def problem(rng, sizes):
    """A row to hold each unknown, and random rows of few entries, as sparse rows and dense."""
    size = int(sum(sizes))
    columns = [np.array([k]) for k in range(size)]
    columns += [rng.permutation(size)[: rng.integers(1, min(size, 5) + 1)] for _ in range(3 * size)]
    starts, values = np.cumsum([0, *map(len, columns)]), rng.normal(size=sum(map(len, columns)))
    dense = np.zeros((len(columns), size))
    dense[np.repeat(np.arange(len(columns)), np.diff(starts)), np.concatenate(columns)] = values
    dense[np.arange(size), np.arange(size)] = values[:size] = 1.0
    return (starts, np.concatenate(columns), values, rng.normal(size=len(columns))), dense


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_problem_after_problem_is_solved_as_a_dense_one_whether_unknowns_come_or_go(seed):
    rng, out = np.random.default_rng(seed), Elimination()
    sizes = rng.integers(1, 4, 4)
    for _ in range(5):
        rows, dense = problem(rng, sizes)
        factors, slope = factorised(out, rows, sizes)
        normal, right = dense.T @ dense, rng.normal(size=(len(dense.T), 2))
        np.testing.assert_allclose(slope, dense.T @ rows[3], atol=1e-12)
        np.testing.assert_allclose(normal @ factors.solve(slope), slope, atol=1e-8)
        np.testing.assert_allclose(normal @ factors.solve(right), right, atol=1e-8)
        assert sorted(factors.order.tolist()) == list(range(int(sizes.sum())))
        sizes = np.maximum(sizes + rng.integers(-1, 4, 4), 1)


def factorised(out, rows, sizes):
    starts, columns, values, residual = rows
    return out.factorised(starts, columns, values, residual, sizes)


def chain_of(n):
    """Unknowns in a row, each tied to the next, and one tied to all, which comes last."""
    columns = [[k] for k in range(n)] + [[k, k + 1, n] for k in range(n - 1)] + [[n]]
    starts = np.cumsum([0, *map(len, columns)])
    return starts, np.concatenate(columns), np.ones(starts[-1]), np.ones(len(columns))


@pytest.fixture
def searches(monkeypatch):
    found: list = []
    plain = elimination._factor

    def counted(normal, order):
        found.append(order != "NATURAL")
        return plain(normal, order)

    monkeypatch.setattr(elimination, "_factor", counted)
    return found


def test_an_order_goes_on_being_used_while_unknowns_come_and_is_found_again_when_some_go(searches):
    out = Elimination()
    for n in (200, 200, 201, 150, 150):
        factorised(out, chain_of(n), np.array([n, 1]))
    assert searches == [True, False, False, True, False]


def test_an_order_under_which_the_factors_fill_up_is_found_again(searches):
    out, rng = Elimination(), np.random.default_rng(0)
    factorised(out, chain_of(60), np.array([60, 1]))
    rows, _ = problem(rng, (60, 1))
    for _ in range(3):
        factorised(out, rows, np.array([60, 1]))
    assert searches == [True, False, True, False]
