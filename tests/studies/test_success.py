"""What counts as success, and the figures that are made of it."""

import msgspec
import numpy as np
import pytest
from outcomes import GOOD, outcome

from sonar_explore.studies.results import row_of
from sonar_explore.studies.statistics import median, paired_p_value, rate
from sonar_explore.studies.success import causes_of_failure


@pytest.mark.parametrize(
    ("change", "causes"),
    [
        ({}, []),
        ({"explored_fraction": 0.97, "wall_error_m": 0.15}, []),
        ({"loop_closed": None}, []),
        ({"explored_fraction": 0.969}, ["unexplored"]),
        ({"contacts": 1}, ["contact"]),
        ({"loop_closed": False}, ["loop"]),
        ({"wall_error_m": 0.151}, ["wall error"]),
        ({"wall_error_m": None}, ["wall error"]),
        ({"contacts": 2, "loop_closed": False}, ["contact", "loop"]),
    ],
)
def test_an_episode_succeeds_or_says_every_cause(change, causes):
    assert list(causes_of_failure(msgspec.structs.replace(GOOD, **change))) == causes


def test_an_exception_is_a_cause_of_its_own():
    assert list(causes_of_failure(None)) == ["exception"]


def test_a_rate_carries_its_wilson_interval():
    found = rate(98, 100)
    assert (found.low, found.high) == pytest.approx((0.930, 0.9945), abs=5e-4)
    assert rate(3, 3).high == 1.0 and rate(3, 3).low < 0.5


def test_a_median_carries_a_bootstrap_interval_that_can_be_repeated():
    values = np.random.default_rng(1).exponential(size=100).tolist()
    found = median(values)
    assert found == median(values)
    assert found.low < found.value < found.high
    assert found.value == pytest.approx(np.median(values), abs=1e-6)
    assert median([]) is None
    assert (median([0.5]).low, median([0.5]).high) == (0.5, 0.5)


def test_pairs_that_never_disagree_do_not_differ_and_ten_lost_ones_do():
    assert paired_p_value([True, False], [True, False]) == 1.0
    assert paired_p_value([True] * 10, [False] * 10) < 0.01


def test_a_row_counts_failures_by_cause_and_an_exception_as_a_failure():
    lost = msgspec.structs.replace(GOOD, contacts=1, wall_error_m=0.4)
    row = row_of([outcome(0), outcome(1, summary=lost), outcome(2, summary=None)])
    assert (row.success.successes, row.success.n) == (1, 3)
    assert row.causes == {"contact": 1, "wall error": 1, "exception": 1}
    assert row.wall_error_m.n == 2 and row.misses_goal
