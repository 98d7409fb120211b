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
    believed,
    innovated,
    learned_of_turn,
    learned_of_walls,
    spread,
    updated_covariance,
)


def covariance(rng):
    root = rng.normal(size=(SIZE, SIZE))
    return 0.01 * root @ root.T


def same(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


SIGMAS = (0.02, 0.005, 0.03)
"""Variance of a bearing by one disc, the least, and that along the normal."""


def associations(rng, n):
    """ADR, NDR, normals and discs, and the Jacobian of each, shape (n, 2, 6)."""
    angles, jacobian = rng.uniform(-3, 3, n), np.zeros((n, 2, SIZE))
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    jacobian[:, 0, HEADING], jacobian[:, 1, :2] = 1.0, normals
    return *(0.3 * rng.normal(size=(2, n))), normals, rng.integers(1, 9, n).astype(float), jacobian


@pytest.mark.parametrize("seed", range(10))
def test_what_is_believed_is_sure_within_the_limit_and_no_worse_than_its_rival_by_much(seed):
    rng, n = np.random.default_rng(seed), 12
    p, (adr, ndr, normals, discs, jacobian) = covariance(rng), associations(rng, n)
    root, features = 0.1 * rng.normal(size=(n, 2, 2)), rng.integers(0, 5, n)
    relative = root @ root.transpose(0, 2, 1)
    expected = jacobian @ p @ jacobian.transpose(0, 2, 1) + relative
    expected[:, 0, 0] += SIGMAS[0] / discs + SIGMAS[1]
    expected[:, 1, 1] += SIGMAS[2]
    off = np.column_stack([adr, -ndr])
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(expected, off[:, :, None])[:, :, 0])
    best = np.array([squared[features == feature].min() for feature in features])
    sure = np.median(relative[:, 1, 1])
    found = believed(p, relative, adr, ndr, normals, discs, features, SIGMAS, 3.0, 1.0, sure)
    plainly = (squared <= 3.0) & (squared <= best + 1.0) & (relative[:, 1, 1] <= sure)
    assert found.tolist() == plainly.tolist()


def learned_plainly(p, jacobian, innovation, noise, huber, floor):
    """The covariance after, and the change of the state."""
    expected = np.einsum("ni,ij,nj->n", jacobian, p, jacobian) + noise
    noise = noise * np.maximum(1.0, innovation**2 / (huber * expected))
    gain = p @ jacobian.T @ np.linalg.inv(jacobian @ p @ jacobian.T + np.diag(noise))
    after = (np.eye(SIZE) - gain @ jacobian) @ p
    after[[0, 1, 2], [0, 1, 2]] = np.maximum(after[[0, 1, 2], [0, 1, 2]], floor)
    return after, gain @ innovation


@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_filter_learns_of_walls_and_of_the_turn_what_the_matrices_say(n):
    rng = np.random.default_rng(n)
    p, (adr, ndr, normals, discs, by_pose) = covariance(rng), associations(rng, n)
    sweeps, floor = rng.normal(size=n), np.array([1e-4, 1e-4, 0.5])
    jacobian = np.concatenate([by_pose[:, 0], by_pose[:, 1]])
    jacobian[:n, [TURN, OWN]] = sweeps[:, None]
    noise = np.concatenate([SIGMAS[0] / discs + SIGMAS[1], np.full(n, SIGMAS[2])])
    after, change = learned_plainly(p, jacobian, np.concatenate([adr, -ndr]), noise, 1.0, floor)
    found = p.copy()
    same(learned_of_walls(found, adr, ndr, normals, discs, sweeps, SIGMAS, 1.0, floor), change)
    np.testing.assert_allclose(found, after, atol=1e-9)
    turn = np.zeros((1, SIZE))
    turn[0, [TURN, OWN]] = 1.0
    after, change = learned_plainly(p, turn, np.array([0.3]), np.array([0.01]), 1.0, floor)
    found = p.copy()
    same(learned_of_turn(found, 0.3, 0.01, 1.0, floor), change)
    np.testing.assert_allclose(found, after, atol=1e-9)


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
def test_bits_of_motion_carry_the_covariance_along_one_after_the_other(n):
    rng = np.random.default_rng(n)
    p, transition, walk = covariance(rng), np.eye(SIZE), np.array([0.01, 0.02, 0.03])
    bits = rng.normal(size=(n, 5))
    bits[:, 2] = np.abs(bits[:, 2])
    plain, product = p.copy(), np.eye(SIZE)
    for forward, turn, turned, own, heading in bits:
        along, c, s = walk[0] * abs(forward), math.cos(heading), math.sin(heading)
        motion, noise = np.eye(SIZE), np.zeros((SIZE, SIZE))
        motion[:2, HEADING] = -s * forward, c * forward
        motion[HEADING, [TURN, BEND, OWN]] = turn, forward, own
        noise[:2, :2] = along * np.outer((c, s), (c, s))
        noise[HEADING, HEADING] = walk[1] * turned / math.tau + walk[2] * abs(forward)
        plain = motion @ plain @ motion.T + noise
        product = motion @ product
    spread(p, transition, bits, walk)
    same(p, plain)
    same(transition, product)
