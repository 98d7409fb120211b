# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Sums of kernels are those of numpy, and of arithmetic with one rounding."""

import math
from fractions import Fraction

import numpy as np
import pytest

from sonar_explore.compiled import kernel
from sonar_explore.sums import dot, fma, hypot, total


@kernel
def compiled_total(values):
    return total(values)


@kernel
def compiled_dot(a, b):
    return dot(a, b)


@kernel
def compiled_fma(a, b, c):
    return fma(a, b, c)


@kernel
def compiled_hypot(x, y):
    return hypot(x, y)


@pytest.mark.parametrize("n", [*range(20), 63, 64, 127, 128])
def test_a_total_is_numpys_to_the_last_bit(n):
    for seed in range(20):
        values = np.random.default_rng(seed).normal(size=(n, 2))
        assert compiled_total(values[:, 0].copy()) == values[:, 0].sum()


def test_a_product_and_a_sum_are_rounded_once():
    for a, b, c in np.random.default_rng(0).normal(size=(500, 3)).tolist():
        exact = float(Fraction(a) * Fraction(b) + Fraction(c))
        assert compiled_fma(a, b, c) == fma(a, b, c) == exact
    assert fma(math.inf, 1.0, 0.0) == math.inf


@pytest.mark.parametrize("n", range(9))
def test_a_dot_product_is_that_of_numpy_but_for_rounding(n):
    a, b = np.random.default_rng(n).normal(size=(2, n))
    assert compiled_dot(a, b) == pytest.approx(a @ b, abs=1e-15)


def test_a_length_is_that_of_python_to_the_last_bit():
    for x, y in np.random.default_rng(0).uniform(-5, 5, (5000, 2)).tolist():
        assert compiled_hypot(x, y) == math.hypot(x, y)
    assert compiled_hypot(0.0, 0.0) == 0.0
