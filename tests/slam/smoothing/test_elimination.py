# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Factors of a problem that grows and changes solve it, however little of them is made anew."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.slam.smoothing import elimination
from sonar_explore.slam.smoothing.cholesky import eliminated, solved
from sonar_explore.slam.smoothing.elimination import Elimination
from sonar_explore.slam.smoothing.factor_graph import FactorGraph, FactorKind


class Grown:
    """A graph of random factors, and which of its variables they changed since the last look."""

    def __init__(self, seed):
        self.rng, self.graph, self.elimination = np.random.default_rng(seed), FactorGraph(), Elimination()
        self._touched: set[int] = set()
        self.graph.add_variable(0.0, 0.0, 0.0)
        for _ in range(4):
            self.variable()

    def variable(self):
        """A new one, held by a factor of its own."""
        k = self.graph.add_variable(*np.zeros(self.rng.integers(2, 5)))
        self.factor(k, -1, hold=True)
        self.factor(k, -1, hold=True)
        return k

    def factor(self, first, second, *, hold=False):
        f = self.graph.add_factor(FactorKind.LINE, first, second, ())
        rows = self.graph.rows[f]
        rows[:, : self.graph.dims[first]] = self.rng.normal(size=(3, self.graph.dims[first]))
        if second >= 0:
            rows[:, 4 : 4 + self.graph.dims[second]] = self.rng.normal(size=(3, self.graph.dims[second]))
        rows[:, 8:] = self.rng.normal(size=(3, 3)) * (1.0 if hold else 0.3)
        self.graph.off[f] = self.rng.normal(size=3)
        self._touched |= {0, first, max(second, 0)}

    def any_factor(self):
        first, second = self.rng.permutation(np.arange(1, self.graph.variables))[:2]
        self.factor(int(first), int(second))

    def renew(self, f):
        self.graph.rows[f] *= self.rng.uniform(0.5, 2.0)
        self._touched |= {0, *np.maximum(self.graph.ends[f], 0).tolist()}

    def put_together(self, stays, goes):
        moved = self.graph.ends[:, 1] == goes
        self.graph.rows[moved, :, 4 + self.graph.dims[stays] : 8] = 0.0
        self._touched |= {stays, goes, *self.graph.ends[moved, 0].tolist()}
        self.graph.put_together(stays, goes)

    def eliminated(self):
        """Which variables were."""
        touched = np.zeros(self.graph.variables, dtype=bool)
        touched[list(self._touched)] = True
        self._touched.clear()
        graph = self.graph
        self.blocks = self.elimination.lay_out(graph, touched)
        starts, factors, order, rank, layout, struct, factor, forward = self.blocks
        by = graph.rows[:, :, 8:].reshape(-1, 3)
        shared = np.column_stack([by.T @ by, by.T @ graph.off.ravel()])
        eliminated(
            *(starts, factors, graph.ends, graph.rows, graph.off, shared, order, rank, graph.dims),
            *(touched, layout, struct, factor, forward),
        )
        return touched

    def solved(self):
        """With the factor as it was laid out."""
        _, _, order, _, layout, struct, factor, forward = self.blocks
        out = np.zeros((self.graph.variables, 4))
        solved(order, self.graph.dims, layout, struct, factor, forward, out)
        return out

    def dense(self):
        """J'J and J'r over all numbers that the variables have, and which of the four of each they are."""
        graph = self.graph
        jacobian = np.zeros((graph.factors, 3, graph.variables, 4))
        for f, (first, second) in enumerate(graph.ends):
            jacobian[f, :, first] += graph.rows[f, :, :4]
            jacobian[f, :, max(second, 0)] += graph.rows[f, :, 4:8] if second >= 0 else 0.0
            jacobian[f, :, 0, :3] += graph.rows[f, :, 8:]
        used = np.arange(4) < graph.dims[:, None]
        jacobian = jacobian.reshape(3 * graph.factors, -1)[:, used.ravel()]
        return jacobian.T @ jacobian, jacobian.T @ graph.off.ravel(), used


def check(grown):
    normal, right, used = grown.dense()
    found = grown.solved()
    np.testing.assert_allclose(found[used], np.linalg.solve(normal, right), atol=1e-7)
    assert (found[~used] == 0.0).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_problem_after_problem_is_solved_as_a_dense_one(seed):
    grown = Grown(seed)
    for _ in range(12):
        for _ in range(grown.rng.integers(0, 3)):
            grown.variable()
        for _ in range(grown.rng.integers(0, 4)):
            grown.any_factor()
        for f in grown.rng.integers(grown.graph.factors, size=2):
            grown.renew(f)
        grown.eliminated()
        check(grown)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_variables_that_became_one_are_one(seed):
    grown = Grown(seed)
    for _ in range(20):
        grown.any_factor()
    grown.eliminated()
    stays, goes = map(int, grown.rng.permutation(np.arange(1, 5))[:2])
    kept = grown.graph.ends[:, 0] != goes
    if (grown.graph.ends[~kept, 1] >= 0).any() or grown.graph.dims[stays] < grown.graph.dims[goes]:
        return  # only what is heard, the second end of its factors, becomes one
    grown.put_together(stays, goes)
    grown.eliminated()
    check(grown)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_covariances_are_those_of_the_inverse(seed):
    grown = Grown(seed)
    for _ in range(8):
        grown.variable()
        grown.any_factor()
    grown.eliminated()
    normal, _, used = grown.dense()
    variables = grown.rng.integers(1, grown.graph.variables, size=5)
    other = int(grown.rng.integers(1, grown.graph.variables))
    by, by_other = grown.rng.normal(size=(2, 5, 4, 3)) * used[[variables, np.full(5, other)]][..., None]
    found = grown.elimination.covariances(variables, by, other, by_other)
    for k, variable in enumerate(variables):
        ask = np.zeros((*used.shape, 3))
        ask[variable] += by[k]
        ask[other] += by_other[k]
        ask = ask[used]
        np.testing.assert_allclose(found[k], ask.T @ np.linalg.solve(normal, ask), atol=1e-7)


def chain_of(n):
    """Variables in a row, each tied to the next."""
    grown = Grown(0)
    for _ in range(n - 4):
        grown.variable()
    for k in range(1, n):
        grown.factor(k, k + 1)
    grown.eliminated()
    return grown


def test_a_change_at_the_end_of_a_chain_eliminates_little_again():
    grown = chain_of(60)
    assert not grown.eliminated().any()
    k = grown.variable()
    grown.factor(k - 1, k)
    assert 3 <= grown.eliminated().sum() <= 10
    check(grown)


def test_an_order_is_kept_until_the_factor_has_filled_up(monkeypatch):
    grown, found = chain_of(60), []
    ordered = elimination.ordered

    def noted(graph):
        found.append(1)
        return ordered(graph)

    monkeypatch.setattr(elimination, "ordered", noted)
    for _ in range(3):
        grown.renew(40)
        grown.eliminated()
    assert not found
    for _ in range(40):
        grown.any_factor()
        grown.eliminated()
    assert 1 <= len(found) < 30
    check(grown)


def test_the_order_takes_what_is_tied_to_least_first_and_the_constants_last():
    graph = FactorGraph()
    graph.add_variable(0.0, 0.0, 0.0)
    for _ in range(6):
        graph.add_variable(0.0, 0.0)
    for leaf in (1, 2, 4, 5, 6):
        graph.add_factor(FactorKind.LINE, leaf, 3, ())
    order = elimination.ordered(graph).tolist()
    assert order[-1] == 0 and sorted(order) == list(range(7))
    assert order.index(3) >= 4  # the middle of the star, when it is as good as the last leaf


def test_the_last_scan_and_what_it_heard_come_last_in_the_order_but_for_the_constants():
    graph = FactorGraph()
    graph.add_variable(0.0, 0.0, 0.0)
    scans = [graph.add_variable(*np.zeros(4)) for _ in range(5)]
    lines = [graph.add_variable(0.0, 0.0) for _ in range(6)]
    for scan in scans[:-1]:
        for line in lines:
            graph.add_factor(FactorKind.LINE, scan, line, ())
    for line in lines[2:4]:
        graph.add_factor(FactorKind.LINE, scans[-1], line, ())
    order = elimination.ordered(graph).tolist()
    assert set(order[-4:-1]) == {scans[-1], *lines[2:4]}
    assert order[-1] == 0 and sorted(order) == list(range(12))


def test_a_copy_goes_its_own_way():
    grown = chain_of(20)
    by = np.eye(4, 2)[None]
    before = grown.elimination.covariances(np.array([5]), by, 9, -by)
    kept = grown.elimination.copy()
    grown.renew(11)
    grown.eliminated()
    assert (kept.covariances(np.array([5]), by, 9, -by) == before).all()
    assert (grown.elimination.covariances(np.array([5]), by, 9, -by) != before).any()
