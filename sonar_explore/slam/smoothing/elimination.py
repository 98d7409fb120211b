"""Factors of the normal equations, kept from step to step: only what a change reaches is eliminated again.

The Cholesky factor of J'J has a block of columns for every variable. A block depends on its own factors (of the graph)
and on blocks eliminated before it that reach it: its descendants in the elimination tree. So when factors change, the
variables on the paths from theirs to the root are eliminated again, and all others stay as they are: the Bayes tree of
iSAM2 (Kaess et al. 2012), by blocks of columns in place of cliques.

Finding an order that keeps the factor sparse costs more than eliminating in it. New variables come last in
the order that was, before the constants, until the factor has filled up.
"""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array
from sonar_explore.slam.smoothing.cholesky import covariances
from sonar_explore.slam.smoothing.factor_graph import FactorGraph, doubled

POSE_DIMS = 4
"""Numbers of a scan's pose; no other variable has as many."""
FILLED = 1.2
"""A factor with so many times the entries that it had when the order was found, by the number, wants a new one."""


STRUCT, COUNT, ROOM, BLOCK, SIZE, SPACE = range(6)
"""Of each variable: where in `_struct` the variables begin that its block of columns has rows of, how many there are,
and for how many there is room; where in `_factor` its block begins, how many numbers it has, for how many is room."""


Tree = tuple[
    NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array
]
"""Rank, parent and how many numbers each variable has, layout, struct and factor, as `Elimination` and `Blocks` say."""


class Blocks(NamedTuple):
    """What the kernels make the factor in."""

    starts: NDArray[np.int64]
    """Variable k has the factors `factors[starts[k]]` to `factors[starts[k + 1]]`, shape (variables + 1,)."""
    factors: NDArray[np.int64]
    order: NDArray[np.int64]
    """The variables, first eliminated first, the constants last."""
    rank: NDArray[np.int64]
    """Where each stands in it, -1 for one that nothing is measured of any more."""
    layout: NDArray[np.int64]
    struct: NDArray[np.int64]
    factor: Array
    forward: Array
    """L^-1 J'r, shape (variables, 4)."""


class Elimination:
    """The factor of a graph that grows."""

    def __init__(self) -> None:
        self._variables = 0
        """How many were laid out."""
        self._order: NDArray[np.int64] = np.zeros(64, dtype=np.int64)
        """The variables, first eliminated first, the constants last; as far as `_used` says."""
        self._rank: NDArray[np.int64] = np.zeros(64, dtype=np.int64)
        """Where each stands in it, -1 for one that nothing is measured of any more."""
        self._parent: NDArray[np.int64] = np.full(64, -1)
        """Of each variable in the elimination tree, -1 for the root."""
        self._layout: NDArray[np.int64] = np.zeros((64, 6), dtype=np.int64)
        self._forward: Array = np.zeros((64, 4))
        self._starts: NDArray[np.int64] = np.zeros(65, dtype=np.int64)
        self._factors: NDArray[np.int64] = np.zeros(512, dtype=np.int64)
        self._dims: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._struct: NDArray[np.int64] = np.zeros(1024, dtype=np.int64)
        self._factor: Array = np.zeros(8192)
        self._used: NDArray[np.int64] = np.zeros(3, dtype=np.int64)
        """So far, of the two above, and of the order."""
        self._sparse = np.inf
        """Numbers in the factor when the order was found, by the number of unknowns."""
        self._filled = True

    def lay_out(self, graph: FactorGraph, touched: NDArray[np.bool_]) -> Blocks:
        """Room for the factor.

        Args:
            touched: variables that have new factors, or lost some, shape (variables,); becomes those whose blocks must
                be made anew.
        """
        self._grow(graph)
        found, known, n = self._filled, self._variables, graph.variables
        if found:
            known = n
            order = ordered(graph)
            self._order[: len(order)], self._used[2] = order, len(order)
            self._clear(touched)
        while True:
            entries = _lay_out(
                *(graph.ends, graph.dims, touched, known, self._starts, self._factors, self._order),
                *(self._rank, self._parent, self._layout, self._struct, self._used, len(self._factor)),
            )
            known = n
            if entries >= 0.0:
                break
            self._struct = np.zeros(2 * len(self._struct), dtype=np.int64)
            self._factor = np.zeros(2 * len(self._factor))
            self._clear(touched)
        self._dims, self._variables = graph.dims, n
        self._sparse = entries if found else self._sparse
        self._filled = entries > FILLED * self._sparse
        order, rank, layout = self._order[: self._used[2]], self._rank[:n], self._layout[:n]
        forward = self._forward[:n]
        return Blocks(self._starts, self._factors, order, rank, layout, self._struct, self._factor, forward)

    @property
    def tree(self) -> Tree:
        """The factor and the elimination tree, as `cholesky.covariances` takes them."""
        return self._rank, self._parent, self._dims, self._layout, self._struct, self._factor

    def covariances(self, variables: NDArray[np.intp], by: Array, other: int, by_other: Array) -> Array:
        """Of numbers that depend on one variable each and on another that is the same for all, shape (k, m, m).

        Args:
            variables: shape (k,).
            by: derivatives of m numbers by the variable, shape (k, 4, m).
            by_other: and by the other, shape (k, 4, m).
        """
        k, _, m = by.shape
        out, half = np.zeros((k, m, m)), np.zeros((len(self._dims), 4, m))
        covariances(
            *(
                np.asarray(variables, dtype=np.int64),
                by,
                other,
                by_other,
                self._rank,
                self._parent,
                self._dims,
            ),
            *(self._layout, self._struct, self._factor, half, out),
        )
        return out

    def copy(self) -> Elimination:
        """As it is now."""
        out = copy(self)
        for name in (
            "_order",
            "_rank",
            "_parent",
            "_layout",
            "_forward",
            "_starts",
            "_factors",
            "_struct",
            "_factor",
            "_used",
        ):
            setattr(out, name, getattr(self, name).copy())
        return out

    def _grow(self, graph: FactorGraph) -> None:
        while len(self._rank) < graph.variables:
            for name in ("_order", "_rank", "_parent", "_layout", "_forward"):
                setattr(self, name, doubled(getattr(self, name)))
            self._starts = np.zeros(len(self._rank) + 1, dtype=np.int64)
        while len(self._factors) < 2 * graph.factors:
            self._factors = doubled(self._factors)

    def _clear(self, touched: NDArray[np.bool_]) -> None:
        """Nothing is eliminated."""
        self._layout[:], self._used[:2], touched[:] = 0, 0, True


def ordered(graph: FactorGraph) -> NDArray[np.int64]:
    """The variables that anything is measured of by minimum degree, and the constants.

    The last scan and what it heard come last of all: the next scan will be tied to them, and what is changed late in
    the order changes little else (the constrained order of iSAM2).
    """
    order = np.empty(graph.variables, dtype=np.int64)
    return order[: _order(graph.ends, graph.dims, order)]


@kernel
def _order(ends, dims, order):  # type: ignore[no-untyped-def]
    """`ordered` into `order`; how many."""
    number, used, last = np.full(len(dims), -1), np.empty(len(dims), dtype=np.int64), -1
    for f in range(len(ends)):
        for side in range(2):
            if ends[f, side] > 0:
                number[ends[f, side]] = 0
    n = 0
    for v in range(1, len(dims)):
        if number[v] == 0:
            number[v], used[n] = n, v
            last = n if dims[v] == POSE_DIMS else last
            n += 1
    tied, late = np.zeros((n, n), dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    for f in range(len(ends)):
        if ends[f, 1] >= 0:
            i, j = number[ends[f, 0]], number[ends[f, 1]]
            tied[i, j] = tied[j, i] = True
    if last >= 0:
        late[:] = tied[last]
        late[last] = True
    _minimum_degree(tied, dims[used[:n]], late, order)
    for p in range(n):
        order[p] = used[order[p]]
    order[n] = 0
    return n + 1


@kernel
def _minimum_degree(tied, dims, late, order):  # type: ignore[no-untyped-def]
    """Always the variable with fewest numbers tied to it is eliminated next, which ties all of them (Tinney and
    Walker 1967); of several, the oldest. The `late` ones wait until none else is left."""
    n = len(dims)
    degree, done = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    for i in range(n):
        for j in range(n):
            if tied[i, j]:
                degree[i] += dims[j]
    around = np.empty(n, dtype=np.int64)
    for p in range(n):
        v = -1
        for i in range(n):
            if done[i] or (v >= 0 and late[i] and not late[v]):
                continue
            if v < 0 or (late[v] and not late[i]) or degree[i] < degree[v]:
                v = i
        order[p], done[v] = v, True
        count = 0
        for i in range(n):
            if tied[v, i] and not done[i]:
                around[count] = i
                count += 1
        for k in range(count):
            i = around[k]
            degree[i] -= dims[v]
            for m in range(k):
                j = around[m]
                if not tied[i, j]:
                    tied[i, j] = tied[j, i] = True
                    degree[i] += dims[j]
                    degree[j] += dims[i]


@inner_kernel
def _list_factors(ends, n, starts, factors):  # type: ignore[no-untyped-def]
    """Those of each of n variables but the constants: variable k has `factors[starts[k]:starts[k + 1]]`."""
    for k in range(n + 1):
        starts[k] = 0
    for f in range(len(ends)):
        for side in range(2):
            if ends[f, side] >= 0:
                starts[ends[f, side]] += 1
    total = 0
    for k in range(n + 1):
        total += starts[k]
        starts[k] = total
    for f in range(len(ends) - 1, -1, -1):
        for side in range(2):
            if ends[f, side] >= 0:
                starts[ends[f, side]] -= 1
                factors[starts[ends[f, side]]] = f


@inner_kernel
def _rank_new(order, used, known, n, rank, parent):  # type: ignore[no-untyped-def]
    """Variables from `known` on are in no order yet: they come last in it, before the constants; the rank of all."""
    for v in range(known, n):
        order[used[2] - 1], order[used[2]], parent[v] = v, 0, -1
        used[2] += 1
    for v in range(n):
        rank[v] = -1
    for p in range(used[2]):
        rank[order[p]] = p


@kernel
def _lay_out(  # type: ignore[no-untyped-def]
    ends, dims, touched, known, starts, factors, order, rank, parent, layout, struct, used, capacity
):
    """Which rows each block of columns has, for the touched and for all above them.

    Those of its factors, and those of its children in the elimination tree (George and Liu 1981).

    Args:
        known: how many variables there were when it was last laid out.

    Returns:
        How many numbers the factor has by each unknown, -1 where there was no room.
    """
    n = len(dims)
    _list_factors(ends, n, starts, factors)
    _rank_new(order, used, known, n, rank, parent)
    child, sibling = np.full(n, -1), np.empty(n, dtype=np.int64)
    stamp, found = np.full(n, -1), np.empty(n, dtype=np.int64)
    entries = unknowns = 0
    for p in range(used[2]):
        v = order[p]
        if touched[v]:
            count = 0
            stamp[v] = v
            if v != 0:
                found[0], count, stamp[0] = 0, 1, v
            for k in range(starts[v], starts[v + 1]):
                for side in range(2):
                    u = ends[factors[k], side]
                    if u >= 0 and rank[u] > p and stamp[u] != v:
                        found[count], stamp[u] = u, v
                        count += 1
            k = child[v]
            while k >= 0:
                for i in range(layout[k, 0], layout[k, 0] + layout[k, 1]):
                    u = struct[i]
                    if stamp[u] != v:
                        found[count], stamp[u] = u, v
                        count += 1
                k = sibling[k]
            _sort(found, count, rank)
            if not _allot(v, found, count, dims, layout, struct, used, capacity):
                return -1.0
            parent[v] = found[0] if count else -1
        entries += layout[v, 4]
        unknowns += dims[v]
        q = parent[v]
        if q >= 0:
            sibling[v], child[q] = child[q], v
            touched[q] = touched[q] or touched[v]
    return entries / unknowns


@inner_kernel
def _sort(found, count, rank):  # type: ignore[no-untyped-def]
    """By rank: few, and nearly in order."""
    for i in range(1, count):
        u, k = found[i], i
        while k > 0 and rank[found[k - 1]] > rank[u]:
            found[k] = found[k - 1]
            k -= 1
        found[k] = u


@inner_kernel
def _allot(v, found, count, dims, layout, struct, used, capacity):  # type: ignore[no-untyped-def]
    """Room for a block, where it was if it still fits; whether there was any."""
    rows = dims[v]
    for i in range(count):
        rows += dims[found[i]]
    size = rows * dims[v]
    if count > layout[v, 2]:
        layout[v, 0], layout[v, 2] = used[0], count + 4
        used[0] += count + 4
    if size > layout[v, 5]:
        layout[v, 3], layout[v, 5] = used[1], size + 16
        used[1] += size + 16
    if used[0] > len(struct) or used[1] > capacity:
        return False
    layout[v, 1], layout[v, 4] = count, size
    for i in range(count):
        struct[layout[v, 0] + i] = found[i]
    return True
