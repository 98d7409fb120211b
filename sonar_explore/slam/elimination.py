"""Factors of the normal equations, kept from step to step: only what a change reaches is eliminated again.

The Cholesky factor of J'J has a block of columns for every variable. A block depends on its own factors (of the graph)
and on blocks eliminated before it that reach it: its descendants in the elimination tree. So when factors change, the
variables on the paths from theirs to the root are eliminated again, and all others stay as they are: the Bayes tree of
iSAM2 (Kaess et al. 2012), by blocks of columns in place of cliques.

Finding an order that keeps the factor sparse costs more than eliminating in it. New variables come last in
the order that was, before the constants, until the factor has filled up.
"""

from __future__ import annotations

import math
from copy import copy

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel, lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.slam.factor_graph import CONSTANTS, FactorGraph

FILLED = 1.3
"""A factor with so many times the entries that it had when the order was found, by the number, wants a new one."""


STRUCT, COUNT, ROOM, BLOCK, SIZE, SPACE = range(6)
"""Of each variable: where in `_struct` the variables begin that its block of columns has rows of, how many there are,
and for how many there is room; where in `_factor` its block begins, how many numbers it has, for how many is room."""


class Elimination:
    """The factor of a graph that grows."""

    def __init__(self) -> None:
        self._order: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        """The variables, first eliminated first, the constants last."""
        self._rank: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        """Where each stands in it, -1 for one that nothing is measured of any more."""
        self._parent: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        """Of each variable in the elimination tree, -1 for the root."""
        self._dims: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._layout: NDArray[np.int64] = np.zeros((0, 6), dtype=np.int64)
        self._struct: NDArray[np.int64] = np.zeros(1024, dtype=np.int64)
        self._factor: Array = np.zeros(8192)
        self._used: NDArray[np.int64] = np.zeros(2, dtype=np.int64)
        """So far, of the two above."""
        self._sparse = np.inf
        """Numbers in the factor when the order was found, by the number of unknowns."""
        self._filled = True

    def eliminate(self, graph: FactorGraph, touched: NDArray[np.bool_]) -> None:
        """Again, where factors of these variables changed, shape (variables,); `touched` becomes all that were."""
        starts, factors = (
            np.zeros(graph.variables + 1, dtype=np.int64),
            np.empty(2 * graph.factors, dtype=np.int64),
        )
        _list_factors(graph.ends, starts, factors)
        found = self._filled
        if found:
            self._order = ordered(graph)
        elif len(self._rank) < graph.variables:
            new = np.arange(len(self._rank), graph.variables)
            self._order = np.concatenate([self._order[:-1], new, self._order[-1:]])
        self._dims = graph.dims
        self._grow(graph.variables)
        self._rank[:] = -1
        self._rank[self._order] = np.arange(len(self._order))
        if found:
            self._clear(touched)
        while not _lay_out(
            *(starts, factors, graph.ends, self._order, self._rank, self._dims, touched),
            *(self._parent, self._layout, self._struct, self._used, len(self._factor)),
        ):
            self._struct = np.zeros(2 * len(self._struct), dtype=np.int64)
            self._factor = np.zeros(2 * len(self._factor))
            self._clear(touched)
        _eliminate(
            *(starts, factors, graph.ends, graph.rows, self._order, self._rank, self._dims, touched),
            *(self._layout, self._struct, self._factor),
        )
        size = self._layout[self._order, SIZE].sum() / self._dims[self._order].sum()
        self._sparse = size if found else self._sparse
        self._filled = bool(size > FILLED * self._sparse)

    def solve(self, right: Array) -> Array:
        """Solution for these right-hand sides, shape (variables, 4), unused numbers zero."""
        out = right.copy()
        _solve(self._order, self._dims, self._layout, self._struct, self._factor, out)
        return out

    def covariances(self, variables: NDArray[np.intp], by: Array, other: int, by_other: Array) -> Array:
        """Of numbers that depend on one variable each and on another that is the same for all, shape (k, m, m).

        Args:
            variables: shape (k,).
            by: derivatives of m numbers by the variable, shape (k, 4, m).
            by_other: and by the other, shape (k, 4, m).
        """
        k, _, m = by.shape
        out, half = np.zeros((k, m, m)), np.zeros((len(self._dims), 4, m))
        _covariances(
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
        for name in ("_rank", "_parent", "_layout", "_struct", "_factor", "_used"):
            setattr(out, name, getattr(self, name).copy())
        return out

    def _grow(self, variables: int) -> None:
        new = variables - len(self._rank)
        if new > 0:
            self._rank = np.concatenate([self._rank, np.full(new, -1)])
            self._parent = np.concatenate([self._parent, np.full(new, -1)])
            self._layout = np.concatenate([self._layout, np.zeros((new, 6), dtype=np.int64)])

    def _clear(self, touched: NDArray[np.bool_]) -> None:
        """Nothing is eliminated."""
        self._layout[:], self._used[:], touched[:] = 0, 0, True


def ordered(graph: FactorGraph) -> NDArray[np.int64]:
    """The variables that anything is measured of by minimum degree, and the constants."""
    used = np.unique(graph.ends)
    used = used[used > CONSTANTS]
    order = np.empty(len(used), dtype=np.int64)
    number = np.zeros(graph.variables, dtype=np.int64)
    number[used] = np.arange(len(used))
    tied = np.zeros((len(used), len(used)), dtype=bool)
    first, second = number[graph.ends[graph.ends[:, 1] >= 0]].T
    tied[first, second] = tied[second, first] = True
    _minimum_degree(tied, graph.dims[used], order)
    return np.append(used[order], CONSTANTS)


@kernel
def _minimum_degree(tied, dims, order):  # type: ignore[no-untyped-def]
    """Always the variable with fewest numbers tied to it is eliminated next, which ties all of them (Tinney and
    Walker 1967); of several, the oldest."""
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
            if not done[i] and (v < 0 or degree[i] < degree[v]):
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


@lean_kernel
def _list_factors(ends, starts, factors):  # type: ignore[no-untyped-def]
    """Those of each variable but the constants: variable k has `factors[starts[k]:starts[k + 1]]`."""
    for f in range(len(ends)):
        for side in range(2):
            if ends[f, side] >= 0:
                starts[ends[f, side]] += 1
    total = 0
    for k in range(len(starts)):
        total += starts[k]
        starts[k] = total
    for f in range(len(ends) - 1, -1, -1):
        for side in range(2):
            if ends[f, side] >= 0:
                starts[ends[f, side]] -= 1
                factors[starts[ends[f, side]]] = f


@kernel
def _lay_out(starts, factors, ends, order, rank, dims, touched, parent, layout, struct, used, capacity):  # type: ignore[no-untyped-def]
    """Which rows each block of columns has, for the touched and for all above them; whether there was room.

    Those of its factors, and those of its children in the elimination tree (George and Liu 1981).
    """
    n = len(rank)
    child, sibling = np.full(n, -1), np.empty(n, dtype=np.int64)
    stamp, found = np.full(n, -1), np.empty(n, dtype=np.int64)
    for p in range(len(order)):
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
                return False
            parent[v] = found[0] if count else -1
        q = parent[v]
        if q >= 0:
            sibling[v], child[q] = child[q], v
            touched[q] = touched[q] or touched[v]
    return True


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


@kernel
def _eliminate(starts, factors, ends, rows, order, rank, dims, touched, layout, struct, factor):  # type: ignore[no-untyped-def]
    """Blocks of columns of the touched variables, each from its factors less what those before it have in its rows."""
    n = len(rank)
    waiting, after = (
        np.full(n, -1),
        np.empty(n, dtype=np.int64),
    )  # by variable, the blocks whose next rows are its
    upto, row = np.zeros(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    place = np.zeros(n, dtype=np.int64)
    for p in range(len(order)):
        v = order[p]
        if touched[v]:
            height = place[v] = 0
            height = dims[v]
            for i in range(layout[v, 0], layout[v, 0] + layout[v, 1]):
                place[struct[i]] = height
                height += dims[struct[i]]
            block = factor[layout[v, 3] : layout[v, 3] + height * dims[v]]
            block[:] = 0.0
            _assemble(v, starts, factors, ends, rows, rank, dims, place, block)
            k = waiting[v]
            while k >= 0:
                _subtract(k, v, upto[k], row[k], dims, layout, struct, factor, place, block)
                k = after[k]
            _cholesky(block, height, dims[v])
        k = waiting[v]
        while k >= 0:
            following = after[k]
            upto[k] += 1
            row[k] += dims[v]
            if upto[k] < layout[k, 1]:
                u = struct[layout[k, 0] + upto[k]]
                after[k], waiting[u] = waiting[u], k
            k = following
        if layout[v, 1] > 0:
            u = struct[layout[v, 0]]
            row[v], after[v], waiting[u] = dims[v], waiting[u], v


@inner_kernel
def _assemble(v, starts, factors, ends, rows, rank, dims, place, block):  # type: ignore[no-untyped-def]
    """The columns of J'J of one variable, from its own rows on."""
    d = dims[v]
    if v == 0:
        for f in range(len(ends)):
            for i in range(3):
                for j in range(3):
                    for k in range(3):
                        block[k * 3 + j] += rows[f, i, 8 + j] * rows[f, i, 8 + k]
        return
    for at in range(starts[v], starts[v + 1]):
        f = factors[at]
        side = 0 if ends[f, 0] == v else 1
        mine, theirs, u = 4 * side, 4 - 4 * side, ends[f, 1 - side]
        beyond = u >= 0 and rank[u] > rank[v]
        for i in range(3):
            for j in range(d):
                x = rows[f, i, mine + j]
                if x == 0.0:
                    continue
                for k in range(d):
                    block[k * d + j] += rows[f, i, mine + k] * x
                for k in range(3):
                    block[(place[0] + k) * d + j] += rows[f, i, 8 + k] * x
                if beyond:
                    for k in range(dims[u]):
                        block[(place[u] + k) * d + j] += rows[f, i, theirs + k] * x
    for j in range(d):
        if block[j * d + j] == 0.0:  # of what became another, nothing is measured any more
            block[j * d + j] = 1.0


@inner_kernel
def _subtract(k, v, upto, row, dims, layout, struct, factor, place, block):  # type: ignore[no-untyped-def]
    """What the block of k, whose rows from `row` on are those of v and of the variables after it, has in that of v."""
    d, dv, at = dims[k], dims[v], layout[k, 3]
    mine = at + row * d
    theirs = mine
    for i in range(layout[k, 0] + upto, layout[k, 0] + layout[k, 1]):
        u = struct[i]
        to = place[u] * dv
        for _ in range(dims[u]):
            for j in range(dv):
                x, y = theirs, mine + j * d
                total = factor[x] * factor[y] + factor[x + 1] * factor[y + 1]
                if d == 4:
                    total += factor[x + 2] * factor[y + 2] + factor[x + 3] * factor[y + 3]
                elif d == 3:
                    total += factor[x + 2] * factor[y + 2]
                block[to] -= total
                to += 1
            theirs += d


@inner_kernel
def _cholesky(block, height, d):  # type: ignore[no-untyped-def]
    """Of the square on top; the rows below times the inverse of its transpose."""
    for i in range(height):
        for j in range(min(i + 1, d)):
            total = block[i * d + j]
            for k in range(j):
                total -= block[i * d + k] * block[j * d + k]
            block[i * d + j] = math.sqrt(total) if i == j else total / block[j * d + j]


@lean_kernel
def _solve(order, dims, layout, struct, factor, x):  # type: ignore[no-untyped-def]
    """L L' x = right, in place."""
    for p in range(len(order)):
        v = order[p]
        d, at = dims[v], layout[v, 3]
        for i in range(d):
            for k in range(i):
                x[v, i] -= factor[at + i * d + k] * x[v, k]
            x[v, i] /= factor[at + i * d + i]
        at += d * d
        for k in range(layout[v, 0], layout[v, 0] + layout[v, 1]):
            u = struct[k]
            for i in range(dims[u]):
                for j in range(d):
                    x[u, i] -= factor[at + j] * x[v, j]
                at += d
    for p in range(len(order) - 1, -1, -1):
        v = order[p]
        d = dims[v]
        at = layout[v, 3] + d * d
        for k in range(layout[v, 0], layout[v, 0] + layout[v, 1]):
            u = struct[k]
            for i in range(dims[u]):
                for j in range(d):
                    x[v, j] -= factor[at + j] * x[u, i]
                at += d
        at = layout[v, 3]
        for i in range(d - 1, -1, -1):
            for k in range(i + 1, d):
                x[v, i] -= factor[at + k * d + i] * x[v, k]
            x[v, i] /= factor[at + i * d + i]


@lean_kernel
def _covariances(variables, by, other, by_other, rank, parent, dims, layout, struct, factor, half, out):  # type: ignore[no-untyped-def]
    """A' (L L')^-1 A = |L^-1 A|^2: L^-1 A has something only where the tree leads from the two variables."""
    columns = half.shape[2]
    for k in range(len(variables)):
        v, w = variables[k], other
        for i in range(4):
            for c in range(columns):
                half[v, i, c] += by[k, i, c]
                half[w, i, c] += by_other[k, i, c]
        while v >= 0 or w >= 0:
            u = v if w < 0 or (v >= 0 and rank[v] <= rank[w]) else w
            v, w = parent[v] if v == u else v, parent[w] if w == u else w
            d, at = dims[u], layout[u, 3]
            for c in range(columns):
                for i in range(d):
                    for j in range(i):
                        half[u, i, c] -= factor[at + i * d + j] * half[u, j, c]
                    half[u, i, c] /= factor[at + i * d + i]
            at += d * d
            for m in range(layout[u, 0], layout[u, 0] + layout[u, 1]):
                for i in range(dims[struct[m]]):
                    for c in range(columns):
                        for j in range(d):
                            half[struct[m], i, c] -= factor[at + j] * half[u, j, c]
                    at += d
            for c in range(columns):
                for e in range(columns):
                    for i in range(d):
                        out[k, c, e] += half[u, i, c] * half[u, i, e]
            half[u] = 0.0
