"""Numbers that cannot be are refused, wherever they stand in a configuration."""

import math
from typing import Any

import pytest

from sonar_explore.config import ExplorationConfig
from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.options import options, with_option

DEFAULTS = {
    name: value
    for name, value in options(ExplorationConfig()).items()
    if isinstance(value, int | float) and not isinstance(value, bool)
}


def refusal(name: str, value: Any) -> str:
    with pytest.raises(SonarExploreError) as caught:
        with_option(ExplorationConfig(), name, value)
    return str(caught.value)


@pytest.mark.parametrize("name", DEFAULTS)
def test_no_number_at_all_is_refused_by_name(name: str) -> None:
    assert name in refusal(name, math.nan)


@pytest.mark.parametrize("name", sorted({*DEFAULTS} - {"planning.daring_margin_m"}))
def test_a_number_below_zero_is_refused_by_name(name: str) -> None:
    assert name in refusal(name, -DEFAULTS[name] or -1)


def test_gaps_may_be_narrower_than_the_body() -> None:
    assert DEFAULTS["planning.daring_margin_m"] < 0
    assert "finite" in refusal("planning.daring_margin_m", math.inf)


@pytest.mark.parametrize(
    "name",
    ["mapping.resolution_m", "simulator.robot.ping_interval_s", "slam.features.range_max_m", "max_scans"],
)
def test_what_is_divided_by_or_counted_cannot_be_zero(name: str) -> None:
    assert name in refusal(name, 0)


@pytest.mark.parametrize(
    "name", ["simulator.sonar.dropout", "simulator.noise.turn_sigma_rad", "planning.margin_m"]
)
def test_errors_and_margins_may_be_zero(name: str) -> None:
    assert options(with_option(ExplorationConfig(), name, 0.0))[name] == 0.0
