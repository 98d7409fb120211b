"""Normal equations of sparse least squares: the products J'J and J'r, for a Jacobian given by its rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array


def normal_equations(
    starts: NDArray[np.intp], columns: NDArray[np.intp], values: Array, residual: Array, size: int
) -> tuple[sparse.csc_matrix, Array]:
    """J'J, shape (size, size), and J'r, shape (size,); entries of J'J that are exactly 0 are left out.

    Args:
        starts: row k of J has the entries `starts[k]` to `starts[k + 1]`, shape (m + 1,).
        columns: of each entry; none twice in a row.
        values: of each entry.
        residual: r, shape (m,).
        size: how many columns J has.
    """
    square = int((np.diff(starts) ** 2).sum())
    indices, data = np.empty(square, dtype=np.int32), np.empty(square)
    ends, slope = np.zeros(size + 1, dtype=np.int32), np.zeros(size)
    _multiply(starts, columns, values, residual, ends, indices, data, slope)
    product = sparse.csc_matrix((data[: ends[-1]], indices[: ends[-1]], ends), shape=(size, size))
    product.has_sorted_indices = product.has_canonical_format = True
    return product, slope


@kernel
def _multiply(starts, columns, values, residual, ends, indices, data, slope):  # type: ignore[no-untyped-def]
    """Column by column, each sum in the order of the rows (Gustavson 1978)."""
    size, m = len(slope), len(residual)
    first = np.zeros(
        size + 1, dtype=np.int64
    )  # J by columns: the entries of each, and the rows that they stand in
    for entry in range(starts[m]):
        first[columns[entry] + 1] += 1
    for j in range(size):
        first[j + 1] += first[j]
    filled, entries = first[:-1].copy(), np.empty((starts[m], 2), dtype=np.int64)
    for row in range(m):
        for entry in range(starts[row], starts[row + 1]):
            j = columns[entry]
            entries[filled[j], 0], entries[filled[j], 1] = entry, row
            filled[j] += 1
    sums, met = np.zeros(size), np.zeros(size, dtype=np.bool_)
    touched, below = np.empty(len(data), dtype=np.int64), np.empty(len(data))
    tops, count = np.empty(size + 1, dtype=np.int64), 0
    tops[0] = 0
    for j in range(size):
        for k in range(first[j], first[j + 1]):
            value, row = values[entries[k, 0]], entries[k, 1]
            slope[j] += value * residual[row]
            for entry in range(starts[row], starts[row + 1]):
                i = columns[entry]
                if not met[i]:
                    met[i], touched[count] = True, i
                    count += 1
                sums[i] += value * values[entry]
        kept = tops[j]
        for k in range(tops[j], count):
            i = touched[k]
            if sums[i] != 0.0:
                touched[kept], below[kept] = i, sums[i]
                kept += 1
                ends[i + 1] += 1
            sums[i], met[i] = 0.0, False
        tops[j + 1] = count = kept
    for i in range(
        size
    ):  # the product is symmetric: its rows, taken in order, are its columns with sorted rows
        ends[i + 1] += ends[i]
    filled[:] = ends[:-1]
    for j in range(size):
        for k in range(tops[j], tops[j + 1]):
            i = touched[k]
            indices[filled[i]], data[filled[i]] = j, below[k]
            filled[i] += 1
