# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The filter's kernels say what its matrices say."""

import math

import numpy as np
import pytest

from sonar_explore.slam.kalman import (
    BEND,
    HEADING,
    OWN,
    SIZE,
    TURN,
    expected_offsets,
    innovated,
    moved_covariance,
    spread,
    updated_covariance,
)


def covariance(rng):
    root = rng.normal(size=(SIZE, SIZE))
    return 0.01 * root @ root.T


def same(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_a_motion_carries_the_covariance_along(seed):
    rng = np.random.default_rng(seed)
    p, (forward, turn, own, heading) = covariance(rng), rng.normal(size=4)
    along, drift = rng.uniform(0.0, 0.1, 2)
    c, s = math.cos(heading), math.sin(heading)
    motion, noise = np.eye(SIZE), np.zeros((SIZE, SIZE))
    motion[:2, HEADING] = -s * forward, c * forward
    motion[HEADING, [TURN, BEND, OWN]] = turn, forward, own
    noise[:2, :2] = along * np.outer((c, s), (c, s))
    noise[HEADING, HEADING] = drift
    same(moved_covariance(p, forward, turn, own, heading, along, drift), motion @ p @ motion.T + noise)


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_an_association_is_expected_as_far_off_as_pose_and_noise_say(n):
    rng = np.random.default_rng(n)
    p, angles, bearing = covariance(rng), rng.uniform(-3, 3, n), rng.uniform(0.1, 1.0, n)
    adr, ndr, normals = *rng.normal(size=(2, n)), np.column_stack([np.cos(angles), np.sin(angles)])
    jacobian = np.zeros((n, 2, SIZE))
    jacobian[:, 0, HEADING], jacobian[:, 1, :2] = 1.0, normals
    plain = jacobian @ p @ jacobian.transpose(0, 2, 1)
    plain[:, 0, 0] += bearing
    plain[:, 1, 1] += 0.03
    expected, off = np.empty((n, 2, 2)), np.empty((n, 2))
    expected_offsets(p, adr, ndr, normals, bearing, 0.03, expected, off)
    same(expected, plain)
    same(off, np.column_stack([adr, -ndr]))


@pytest.mark.parametrize("n", [1, 2, 6, 20])
def test_an_update_weighs_outliers_down_and_keeps_the_covariance_in_josephs_form(n):
    rng = np.random.default_rng(n)
    p, jacobian, innovation = covariance(rng), rng.normal(size=(n, SIZE)), rng.normal(size=n)
    noise, across, expected = rng.uniform(0.1, 1.0, n), np.empty((n, SIZE)), np.empty((n, n))
    variance = np.einsum("ni,ij,nj->n", jacobian, p, jacobian) + noise
    weighed = noise * np.maximum(1.0, innovation**2 / (1.5 * variance))
    innovated(p, jacobian, innovation, 1.5, noise, across, expected)
    same(noise, weighed)
    same(across, jacobian @ p)
    same(expected, jacobian @ p @ jacobian.T + np.diag(weighed))
    gain = np.ascontiguousarray(np.linalg.solve(expected, across).T)
    kept = np.eye(SIZE) - gain @ jacobian
    joseph = kept @ p @ kept.T + gain @ np.diag(weighed) @ gain.T
    same(updated_covariance(p, gain, jacobian, noise, np.zeros(3)), joseph)
    assert updated_covariance(p, gain, jacobian, noise, np.array([9.0, 0.0, 0.0]))[0, 0] == 9.0


@pytest.mark.parametrize("n", [0, 1, 7])
def test_bits_of_motion_spread_one_after_the_other(n):
    rng = np.random.default_rng(n)
    p, transition, walk = covariance(rng), np.eye(SIZE), np.array([0.01, 0.02, 0.03])
    bits = rng.normal(size=(n, 5))
    bits[:, 2] = np.abs(bits[:, 2])
    plain, product = p.copy(), np.eye(SIZE)
    for forward, turn, turned, own, heading in bits:
        drift = walk[1] * turned / math.tau + walk[2] * abs(forward)
        plain = moved_covariance(plain, forward, turn, own, heading, walk[0] * abs(forward), drift)
        motion = np.eye(SIZE)
        motion[:2, HEADING] = -math.sin(heading) * forward, math.cos(heading) * forward
        motion[HEADING, [TURN, BEND, OWN]] = turn, forward, own
        product = motion @ product
    spread(p, transition, bits, walk)
    same(p, plain)
    same(transition, product)
