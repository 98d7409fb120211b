"""In which order the unknowns of a growing least-squares problem are eliminated.

Finding an order that keeps the factors sparse costs more than factorising in it. A new scan adds few unknowns to a
problem of thousands, so the order of the problem before goes on being used with the new ones at its end (incremental
smoothing does likewise, Kaess et al. 2008), until the factors have filled up or unknowns are taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from sonar_explore.geometry import Array
from sonar_explore.slam.normal_equations import normal_equations

FILLED = 1.15
"""Factors with so many times the entries that they had when the order was found, by the unknown, want a new one."""


@dataclass(frozen=True, eq=False)
class Factors:
    """Of the normal equations, in their order of elimination."""

    factor: SuperLU
    order: NDArray[np.intp]
    """The unknowns, first eliminated first, shape (size,)."""

    def solve(self, right: Array) -> Array:
        """Solution for these right-hand sides, shape (size,) or (size, n)."""
        out = np.empty_like(right)
        out[self.order] = self.factor.solve(right[self.order])
        return out


class Elimination:
    """Factorises problem after problem, each the one before with more unknowns."""

    def __init__(self) -> None:
        self._order: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
        self._sizes: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
        self._entries = 0.0
        """Of the factors when the order was found, by the unknown."""

    def factorised(
        self,
        starts: NDArray[np.intp],
        columns: NDArray[np.intp],
        values: Array,
        residual: Array,
        sizes: NDArray[np.intp],
    ) -> tuple[Factors, Array]:
        """J'J in factors, and J'r, shape (size,).

        Args:
            starts: row k of J has the entries `starts[k]` to `starts[k + 1]`, shape (m + 1,).
            columns: of each entry; none twice in a row.
            values: of each entry.
            residual: r, shape (m,).
            sizes: how many unknowns there are of each kind, in the order of the columns of J, at least one of the last
                kind; new ones are the last of their kind, and those of the last kind are tied to most others.
        """
        size = int(sizes.sum())
        known = len(sizes) == len(self._sizes) and bool((sizes >= self._sizes).all())
        order = self._grown(sizes) if known else np.arange(size)
        rank = np.empty(size, dtype=np.intp)
        rank[order] = np.arange(size)
        normal, slope = normal_equations(starts, rank[columns], values, residual, size)
        factor = _factor(normal, "NATURAL" if known else "MMD_AT_PLUS_A")
        found = Factors(factor, order)
        if known and factor.nnz <= FILLED * self._entries * size:
            self._order, self._sizes = order, sizes
        elif known:
            self._sizes = np.zeros(0, dtype=np.intp)
        else:
            self._order, self._sizes, self._entries = np.argsort(factor.perm_c), sizes, factor.nnz / size
        return found, slope[rank]

    def _grown(self, sizes: NDArray[np.intp]) -> NDArray[np.intp]:
        """The order that was, new unknowns before those of the last kind that it ends with."""
        before, after = np.cumsum(self._sizes) - self._sizes, np.cumsum(sizes) - sizes
        kind = np.searchsorted(before, self._order, side="right") - 1
        moved = self._order + (after - before)[kind]
        new = np.concatenate([a + np.arange(n, m) for a, n, m in zip(after, self._sizes, sizes, strict=True)])
        last = kind == len(sizes) - 1
        return np.concatenate([moved[~last], new, moved[last]])


def _factor(normal: sparse.csc_matrix, order: str) -> SuperLU:
    """Symmetric and positive: no pivots; no zeros stored to make columns alike."""
    return splu(normal, permc_spec=order, diag_pivot_thresh=0.0, relax=1, options={"SymmetricMode": True})
