"""Every departure from the paper is on the list, and the list is true."""

from dataclasses import replace
from pathlib import Path

import pytest

from sonar_explore.config import ExplorationConfig
from sonar_explore.errors import SonarExploreError
from sonar_explore.slam import SlamConfig
from sonar_explore.studies.departures import DEPARTURES, ablation_variants, departures_page
from sonar_explore.studies.options import option, options, with_option

ROOT = Path(__file__).parents[2]


def test_the_page_is_what_the_list_makes():
    assert (ROOT / "docs/departures.md").read_text(encoding="utf-8") == departures_page()


def test_literal_and_the_departures_of_section_iii_make_the_robust_configuration():
    """Whoever adds an option to `SlamConfig.robust()` adds it to the list."""
    config = ExplorationConfig(slam=SlamConfig())
    for departure in DEPARTURES:
        assert departure.in_literal != departure.option.startswith("slam.")
        config = with_option(config, departure.option, departure.on)
    assert config == ExplorationConfig()


@pytest.mark.parametrize("departure", DEPARTURES, ids=lambda d: d.name)
def test_each_arm_turns_off_one_option(departure):
    default, off = options(ExplorationConfig()), options(departure.off.applied_to(ExplorationConfig()))
    assert [name for name in default if default[name] != off[name]] == [departure.option]


def test_the_arms_have_names_of_their_own():
    names = [variant.name for variant in ablation_variants()]
    assert len(set(names)) == len(names) == len(DEPARTURES) + 2


def test_an_unknown_option_is_one_line_that_names_the_known_ones():
    for broken in ("slam.magic", "slam.features.beam_check.more"):
        with pytest.raises(SonarExploreError, match="unknown option"):
            option(ExplorationConfig(), broken)
    with pytest.raises(SonarExploreError, match="beam_check"):
        with_option(ExplorationConfig(), "slam.features.magic", True)


def test_options_are_changed_in_a_copy():
    config = ExplorationConfig()
    assert with_option(config, "max_scans", 5) == replace(config, max_scans=5)
    assert config.max_scans == ExplorationConfig().max_scans
