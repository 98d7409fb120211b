"""Gauss-Newton on a factor graph, with normal equations that are renewed where they changed."""

from __future__ import annotations

import numpy as np

from sonar_explore.compiled import kernel
from sonar_explore.slam.cholesky import eliminated, solved
from sonar_explore.slam.jacobian import linearised


@kernel
def descended(problem, blocks, dims, poses, still, huber, renew, steps, touched):  # type: ignore[no-untyped-def]
    """Step by step until no pose moves by more than `still`; the number of steps.

    Args:
        problem: kinds, ends, measured, values and rows of a `FactorGraph`; values and rows change.
        blocks: `elimination.Blocks`; the factor changes.
        poses: the variables that must stand still.
        still: x, y [m], heading [rad].
        touched: variables whose blocks must be made in any case.
    """
    kinds, ends, measured, values, rows = problem
    starts, factors, order, rank, layout, struct, factor = blocks
    step, row, off = np.empty_like(values), np.empty((3, 11)), np.empty(3)
    for count in range(steps):
        linearised(kinds, ends, measured, values, huber, renew, rows, row, off, step, touched)
        eliminated(starts, factors, ends, rows, order, rank, dims, touched, layout, struct, factor)
        solved(order, dims, layout, struct, factor, step)
        moves = False
        for v in range(len(values)):
            for i in range(4):
                values[v, i] -= step[v, i]
        for v in poses:
            for i in range(3):
                moves = moves or abs(step[v, i]) > still[i]
        if not moves:
            return count + 1
        touched[:] = False
    return steps
