"""Gauss-Newton on a factor graph, linearised anew, and its normal equations renewed, where it has moved.

Fluid relinearisation, as iSAM2 has it (Kaess et al. 2012): all factors of a variable are linearised at one value of it,
its anchor, and stay so until the solution has left it by more than a limit. Since no variable has two anchors, a motion
of the whole map, or of a part that hangs on the rest by little, costs the linear problem no more than it should: the
derivatives by it vanish where those of the measurements do.
"""

from __future__ import annotations

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.slam.smoothing.cholesky import eliminated, solved
from sonar_explore.slam.smoothing.jacobian import linearised, losses

UPHILL = 0.01
"""A step that makes everything fit worse by more than this is halved, in squared sigmas,"""
FAR_M, FAR_RAD = 0.1, 0.05
"""if it moves any pose by more than this; whether shorter ones do is not looked at."""
HALVINGS = 6
"""Then it is given up."""


@kernel
def descended(  # type: ignore[no-untyped-def]
    kinds,
    ends,
    measured,
    values,
    anchors,
    limits,
    rows,
    off,
    shared,
    starts,
    factors,
    order,
    rank,
    layout,
    struct,
    factor,
    forward,
    dims,
    poses,
    still,
    huber,
    known,
    steps,
    stale,
    touched,
):
    """Step by step until no pose moves by more than `still`; the number of steps.

    Args:
        kinds: with all up to `shared` those of a `FactorGraph`; values, anchors and from rows on all change.
        starts: with all up to `forward` those of `elimination.Blocks`; factor and forward change.
        dims: how many numbers each variable has.
        poses: the variables that must stand still.
        still: x, y [m], heading [rad].
        known: factors from here on were never linearised, or by the other loss.
        stale: variables whose factors must be linearised anew in any case.
        touched: and those whose blocks must be made.
    """
    step, kept, far = np.zeros_like(values), np.empty_like(values), (FAR_M, FAR_M, FAR_RAD)
    for count in range(steps):
        _anchor(values, limits, anchors, stale)
        known = 0 if stale[0] else known  # all are tied to the constants
        linearised(kinds, ends, measured, anchors, huber, known, stale, rows, off, shared, touched)
        eliminated(
            starts,
            factors,
            ends,
            rows,
            off,
            shared,
            order,
            rank,
            dims,
            touched,
            layout,
            struct,
            factor,
            forward,
        )
        solved(order, dims, layout, struct, factor, forward, step)
        known = len(kinds)
        kept[:] = values
        _step(anchors, step, values)
        if not _moved(kept, values, poses, still):
            return count + 1
        if _moved(kept, values, poses, far) and not _downhill(kinds, ends, measured, kept, values, huber):
            return count + 1
        stale[:], touched[:] = False, False
    return steps


@inner_kernel
def _anchor(values, limits, anchors, stale):  # type: ignore[no-untyped-def]
    """Variables that have left their anchors are stale; all that are have new ones."""
    for v in range(len(values)):
        for i in range(4):
            stale[v] = stale[v] or not abs(values[v, i] - anchors[v, i]) <= limits[v, i]
        if stale[v]:
            for i in range(4):
                anchors[v, i] = values[v, i]


@inner_kernel
def _step(anchors, step, values):  # type: ignore[no-untyped-def]
    for v in range(len(values)):
        for i in range(4):
            values[v, i] = anchors[v, i] - step[v, i]


@inner_kernel
def _moved(before, after, poses, still):  # type: ignore[no-untyped-def]
    """Whether any of the poses has; by no number at all it has."""
    for v in poses:
        for i in range(3):
            if not abs(after[v, i] - before[v, i]) <= still[i]:
                return True
    return False


@kernel
def _downhill(kinds, ends, measured, kept, values, huber):  # type: ignore[no-untyped-def]
    """Halve the way from what was kept until all fits no worse than there; whether that was to be had."""
    row, off = np.empty((3, 11)), np.empty(3)
    _, lowest = losses(kinds, ends, measured, kept, huber, row, off)
    for _ in range(HALVINGS):
        _, total = losses(kinds, ends, measured, values, huber, row, off)
        if total <= lowest + UPHILL:
            return True
        values[:] = 0.5 * (kept + values)
    values[:] = kept
    return False
