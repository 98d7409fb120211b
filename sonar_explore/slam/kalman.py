"""The steps of the filter beside the link graph, as kernels: matrices so small that each call of numpy costs more."""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.sums import fma

X, Y, HEADING, TURN, BEND, OWN = range(6)
SIZE = 6


@inner_kernel
def _product(a, b, out):  # type: ignore[no-untyped-def]
    """`a @ b` into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            added = 0.0
            for k in range(a.shape[1]):
                added = fma(a[i, k], b[k, j], added)
            out[i, j] = added


@inner_kernel
def _product_turned(a, b, out):  # type: ignore[no-untyped-def]
    """`a @ b.T` into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[0]):
            added = 0.0
            for k in range(a.shape[1]):
                added = fma(a[i, k], b[j, k], added)
            out[i, j] = added


@kernel
def spread(covariance, transition, bits, walk):  # type: ignore[no-untyped-def]
    """Let a covariance grow by bits of motion, F P F' + Q, and multiply their F into `transition`, both in place.

    A bit is metres forward, turn, turn but for the own part, own part, and the heading; `walk` has the variances of a
    metre's length, of a full turn and of a metre's heading.
    """
    size = len(covariance)
    motion, half = np.zeros((size, size)), np.empty((size, size))
    for i in range(size):
        motion[i, i] = 1.0
    for i in range(len(bits)):
        forward, turn, turned, own, heading = bits[i, 0], bits[i, 1], bits[i, 2], bits[i, 3], bits[i, 4]
        along = walk[0] * abs(forward)
        drift = walk[1] * turned / (2.0 * math.pi) + walk[2] * abs(forward)
        c, s = math.cos(heading), math.sin(heading)
        motion[X, HEADING], motion[Y, HEADING] = -s * forward, c * forward
        motion[HEADING, TURN], motion[HEADING, BEND], motion[HEADING, OWN] = turn, forward, own
        _product(motion, covariance, half)
        _product_turned(half, motion, covariance)
        covariance[X, X] += c * c * along
        covariance[Y, Y] += s * s * along
        covariance[X, Y] += c * s * along
        covariance[Y, X] += c * s * along
        covariance[HEADING, HEADING] += drift
        for j in range(size):
            transition[X, j] -= s * forward * transition[HEADING, j]
            transition[Y, j] += c * forward * transition[HEADING, j]
            transition[HEADING, j] += turn * transition[TURN, j] + forward * transition[BEND, j]
            transition[HEADING, j] += own * transition[OWN, j]


@kernel
def believed(p, relative, adr, ndr, normals, discs, features, sigmas, limit, rival, sure):  # type: ignore[no-untyped-def]
    """Which associations are no farther off, in angle and along the normal, than expected: r' (H P H' + R)^-1 r is
    within the limit, and no worse by more than `rival` than the best of the same feature.

    Args:
        relative: what else each is unsure by, shape (n, 2, 2); along the normal by no more than `sure`.
        discs: how many heard each.
        sigmas: see `bearing_variance`; and the variance along the normal.
    """
    n = len(adr)
    squared, out = np.empty(n), np.empty(n, dtype=np.bool_)
    for i in range(n):
        x, y = normals[i, 0], normals[i, 1]
        angle = p[HEADING, HEADING] + bearing_variance(discs[i], sigmas) + relative[i, 0, 0]
        both = p[HEADING, X] * x + p[HEADING, Y] * y + relative[i, 0, 1]
        place = (
            x * (p[X, X] * x + p[X, Y] * y) + y * (p[Y, X] * x + p[Y, Y] * y) + sigmas[2] + relative[i, 1, 1]
        )
        a, b = adr[i], -ndr[i]
        squared[i] = (a * a * place - 2.0 * a * b * both + b * b * angle) / (angle * place - both * both)
    for i in range(n):
        out[i] = squared[i] <= limit and relative[i, 1, 1] <= sure
        for k in range(n):
            if features[k] == features[i] and squared[i] > squared[k] + rival:
                out[i] = False
    return out


@inner_kernel
def bearing_variance(discs, sigmas):  # type: ignore[no-untyped-def]
    """Of a feature that so many discs heard: that of one disc is shared by all, the least one stays, [rad2]."""
    return sigmas[0] / discs + sigmas[1]


@kernel
def learned_of_walls(p, adr, ndr, normals, discs, sweeps, sigmas, huber, floor):  # type: ignore[no-untyped-def]
    """`learned`, of associations: heading, and the error of the turn by then, by ADR, place by NDR."""
    n = len(adr)
    jacobian, innovation, noise = np.zeros((2 * n, SIZE)), np.empty(2 * n), np.empty(2 * n)
    for i in range(n):
        jacobian[i, HEADING], jacobian[i, TURN], jacobian[i, OWN] = 1.0, sweeps[i], sweeps[i]
        jacobian[n + i, X], jacobian[n + i, Y] = normals[i, 0], normals[i, 1]
        innovation[i], innovation[n + i] = adr[i], -ndr[i]
        noise[i], noise[n + i] = bearing_variance(discs[i], sigmas), sigmas[2]
    return learned(p, jacobian, innovation, noise, huber, floor)


@kernel
def learned_of_turn(p, relative, variance, huber, floor):  # type: ignore[no-untyped-def]
    """`learned`, of what the discs say of the turn."""
    jacobian = np.zeros((1, SIZE))
    jacobian[0, TURN] = jacobian[0, OWN] = 1.0
    return learned(p, jacobian, np.full(1, relative), np.full(1, variance), huber, floor)


@kernel
def learned(p, jacobian, innovation, noise, huber, floor):  # type: ignore[no-untyped-def]
    """One update with Huber's loss: the covariance in place; how the state changes."""
    n = len(innovation)
    across, expected, gain = np.empty((n, SIZE)), np.empty((n, n)), np.empty((SIZE, n))
    innovated(p, jacobian, innovation, huber, noise, across, expected)
    _solve(expected, across)
    change = np.zeros(SIZE)
    for j in range(SIZE):
        for i in range(n):
            gain[j, i] = across[i, j]
            change[j] += across[i, j] * innovation[i]
    after = updated_covariance(p, gain, jacobian, noise, floor)
    for i in range(SIZE):
        for j in range(SIZE):
            p[i, j] = after[i, j]
    return change


@inner_kernel
def _solve(a, b):  # type: ignore[no-untyped-def]
    """a^-1 b into `b`, for a symmetric `a`, positive definite, which is used up: by Cholesky."""
    n = len(a)
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = math.sqrt(total) if i == j else total / a[j, j]
        for c in range(b.shape[1]):
            for k in range(i):
                b[i, c] -= a[i, k] * b[k, c]
            b[i, c] /= a[i, i]
    for i in range(n - 1, -1, -1):
        for c in range(b.shape[1]):
            for k in range(i + 1, n):
                b[i, c] -= a[k, i] * b[k, c]
            b[i, c] /= a[i, i]


@kernel
def innovated(p, jacobian, innovation, huber, noise, across, expected):  # type: ignore[no-untyped-def]
    """H P, and H P H' + R, where R, `noise`, grows for what is farther off than this many squared sigmas."""
    n = len(innovation)
    for i in range(n):
        variance = 0.0
        for j in range(SIZE):
            for k in range(SIZE):
                variance += jacobian[i, j] * p[j, k] * jacobian[i, k]
        noise[i] *= max(1.0, innovation[i] * innovation[i] / (huber * (variance + noise[i])))
    _product(jacobian, p, across)
    _product_turned(across, jacobian, expected)
    for i in range(n):
        expected[i, i] += noise[i]


@kernel
def updated_covariance(p, gain, jacobian, noise, floor):  # type: ignore[no-untyped-def]
    """The covariance after an update, in Joseph's form: (I - K H) P (I - K H)' + K R K'; never below the floor."""
    n = len(noise)
    kept, half, scaled = np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty((SIZE, n))
    covariance, added = np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE))
    _product(gain, jacobian, half)
    for i in range(SIZE):
        for j in range(SIZE):
            kept[i, j] = (1.0 if i == j else 0.0) - half[i, j]
        for j in range(n):
            scaled[i, j] = gain[i, j] * noise[j]
    _product(kept, p, half)
    _product_turned(half, kept, covariance)
    _product_turned(scaled, gain, added)
    for i in range(SIZE):
        for j in range(SIZE):
            covariance[i, j] += added[i, j]
    for i in range(len(floor)):
        covariance[i, i] = max(covariance[i, i], floor[i])
    return covariance
