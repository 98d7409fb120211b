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
def moved_covariance(covariance, forward, turn, own, heading, along, drift):  # type: ignore[no-untyped-def]
    """F P F' + Q: the covariance after a motion; `along` is the variance of its length, `drift` that of its heading."""
    c, s = math.cos(heading), math.sin(heading)
    motion, half, p = np.zeros((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE))
    for i in range(SIZE):
        motion[i, i] = 1.0
    motion[X, HEADING], motion[Y, HEADING] = -s * forward, c * forward
    motion[HEADING, TURN], motion[HEADING, BEND], motion[HEADING, OWN] = turn, forward, own
    _product(motion, covariance, half)
    _product_turned(half, motion, p)
    p[X, X] += c * c * along
    p[Y, Y] += s * s * along
    p[X, Y] += c * s * along
    p[Y, X] += c * s * along
    p[HEADING, HEADING] += drift
    return p


@kernel
def spread(covariance, transition, bits, walk):  # type: ignore[no-untyped-def]
    """Let a covariance grow by bits of motion, and multiply their F into `transition`, both in place.

    A bit is metres forward, turn, turn but for the own part, own part, and the heading; `walk` has the variances of a
    metre's length, of a full turn and of a metre's heading.
    """
    for i in range(len(bits)):
        forward, turn, turned, own, heading = bits[i, 0], bits[i, 1], bits[i, 2], bits[i, 3], bits[i, 4]
        along = walk[0] * abs(forward)
        drift = walk[1] * turned / (2.0 * math.pi) + walk[2] * abs(forward)
        covariance[:, :] = moved_covariance(covariance, forward, turn, own, heading, along, drift)
        c, s = math.cos(heading), math.sin(heading)
        for j in range(SIZE):
            transition[X, j] -= s * forward * transition[HEADING, j]
            transition[Y, j] += c * forward * transition[HEADING, j]
            transition[HEADING, j] += turn * transition[TURN, j] + forward * transition[BEND, j]
            transition[HEADING, j] += own * transition[OWN, j]


@kernel
def expected_offsets(p, adr, ndr, normals, bearing, normal, expected, off):  # type: ignore[no-untyped-def]
    """How far each association is off in angle and along the normal, and the covariance of that: H P H' + R."""
    for i in range(len(adr)):
        x, y = normals[i, 0], normals[i, 1]
        across = fma(y, p[1, 0], x * p[0, 0]), fma(y, p[1, 1], x * p[0, 1])
        expected[i, 0, 0] = p[HEADING, HEADING] + bearing[i]
        expected[i, 0, 1] = fma(p[HEADING, Y], y, p[HEADING, X] * x)
        expected[i, 1, 0] = fma(y, p[Y, HEADING], x * p[X, HEADING])
        expected[i, 1, 1] = fma(across[1], y, across[0] * x) + normal
        off[i, 0], off[i, 1] = adr[i], -ndr[i]


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
