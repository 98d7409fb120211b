"""Gauss-Newton on a factor graph, with normal equations that are renewed where they changed."""

from __future__ import annotations

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.slam.smoothing.cholesky import eliminated, solved
from sonar_explore.slam.smoothing.jacobian import linearised

UPHILL = 0.01
"""A step that makes everything fit worse by more than this is taken back, in squared sigmas."""


@kernel
def descended(  # type: ignore[no-untyped-def]
    kinds,
    ends,
    measured,
    values,
    rows,
    starts,
    factors,
    order,
    rank,
    layout,
    struct,
    factor,
    dims,
    poses,
    still,
    huber,
    renew,
    steps,
    touched,
):
    """Step by step until no pose moves by more than `still`; the number of steps.

    A step that leads uphill is taken back: what had been linearised before and was thought to have changed too little
    is made anew, and where that does not help, the step is halved.

    Args:
        kinds: with all up to `rows` those of a `FactorGraph`; values and rows change.
        starts: with all up to `factor` those of `elimination.Blocks`; the factor changes.
        dims: how many numbers each variable has.
        poses: the variables that must stand still.
        still: x, y [m], heading [rad].
        touched: variables whose blocks must be made in any case.
    """
    step, done = np.empty_like(values), np.empty_like(values)
    row, off = np.empty((3, 11)), np.empty(3)
    kept, share, lowest = values.copy(), 1.0, np.inf
    for count in range(steps + 1):
        _, total = linearised(kinds, ends, measured, values, huber, renew, rows, row, off, step, touched)
        if not total <= lowest + UPHILL:
            if count == steps or renew == 0.0:
                share *= 0.5
                _step(values, kept, done, 0.0 if count == steps else share)
                continue
            renew, touched[:] = 0.0, True
            _step(values, kept, done, 0.0)
            _, total = linearised(kinds, ends, measured, values, huber, renew, rows, row, off, step, touched)
        lowest = total
        if count == steps:
            break
        eliminated(starts, factors, ends, rows, order, rank, dims, touched, layout, struct, factor)
        solved(order, dims, layout, struct, factor, step)
        kept[:], share = values, 1.0
        done, step = step, done
        _step(values, kept, done, share)
        if not _moves(done, poses, still):
            return count + 1
        touched[:] = False
    return steps


@inner_kernel
def _step(values, kept, step, share):  # type: ignore[no-untyped-def]
    """From what was kept this share of the step."""
    for v in range(len(values)):
        for i in range(4):
            values[v, i] = kept[v, i] - share * step[v, i] if share > 0.0 else kept[v, i]


@inner_kernel
def _moves(step, poses, still):  # type: ignore[no-untyped-def]
    """Whether it moves any of the poses; no number at all does."""
    for v in poses:
        for i in range(3):
            if not abs(step[v, i]) <= still[i]:
                return True
    return False
