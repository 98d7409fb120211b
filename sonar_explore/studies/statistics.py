"""Rates and medians with 95 % intervals, and whether two arms differ on the same seeds."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from scipy import stats

CONFIDENCE = 0.95
RESAMPLES = 4000


class Rate(msgspec.Struct, frozen=True):
    """Successes out of n."""

    successes: int
    n: int
    low: float
    """Wilson interval."""
    high: float

    @property
    def value(self) -> float:
        """0 to 1."""
        return self.successes / self.n


class Median(msgspec.Struct, frozen=True):
    """A median over n values."""

    value: float
    low: float
    """Bootstrap percentile interval, always the same for the same values."""
    high: float
    n: int


def rate(successes: int, n: int) -> Rate:
    """With its Wilson interval."""
    interval = stats.binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return Rate(successes, n, round(float(interval.low), 6), round(float(interval.high), 6))


def median(values: Sequence[float]) -> Median | None:
    """With its bootstrap interval; None where there is no value."""
    if not values:
        return None
    data = np.asarray(values, dtype=float)
    draws = np.random.default_rng(0).integers(len(data), size=(RESAMPLES, len(data)))
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(np.median(data[draws], axis=1), [tail, 100.0 - tail])
    middle = float(np.median(data))
    return Median(round(middle, 6), round(float(low), 6), round(float(high), 6), len(data))


def paired_p_value(first: Sequence[bool], second: Sequence[bool]) -> float:
    """McNemar's exact test of two arms over the same seeds: how likely so uneven a change is by chance."""
    won = sum(b and not a for a, b in zip(first, second, strict=True))
    lost = sum(a and not b for a, b in zip(first, second, strict=True))
    return float(stats.binomtest(won, won + lost).pvalue) if won + lost else 1.0
