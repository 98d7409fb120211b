"""Sweeps go around the default, and their sentences say what the numbers say."""

import msgspec
import pytest
from outcomes import GOOD, outcome

from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.record import Stats
from sonar_explore.studies.episode import run_job
from sonar_explore.studies.jobs import Job
from sonar_explore.studies.options import option
from sonar_explore.studies.results import Study, study_of
from sonar_explore.studies.sensitivity import points_of, sentence
from sonar_explore.studies.store import load_record_packed, record_path
from sonar_explore.studies.sweeps import DEFAULT, SWEEPS, sweep_variants

ANGLE = next(s for s in SWEEPS if s.option == "slam.association.angle_max_rad")
SPIN = next(s for s in SWEEPS if s.option == "alternate_spin")


def made_up(sweep, successes: dict, errors: dict | None = None) -> Study:
    """A study of twenty seeds in one world, with so many successes for each value of a sweep."""
    outcomes, variants = [], []
    for value in sweep.values:
        variants.append(sweep.variant(value))
        for seed in range(20):
            lost = 0 if seed < successes.get(value, 20) else 1
            final = (errors or {}).get(value, 0.1)
            stats = Stats(final, final, final)
            summary = msgspec.structs.replace(GOOD, contacts=lost, position_error_m=stats)
            outcomes.append(outcome(seed, sweep.variant(value).name, summary))
    base = ExplorationConfig()
    return study_of(
        "sensitivity", outcomes, worlds=["paper/loop"], variants=variants, seeds=20, noise="paper", base=base
    )


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda s: s.slug)
def test_the_default_is_among_the_values_and_the_others_change_it(sweep):
    assert sweep.values == tuple(sorted(sweep.values))
    for value in sweep.values:
        config = sweep.variant(value).applied_to(ExplorationConfig())
        same = option(config, sweep.option) == option(ExplorationConfig(), sweep.option)
        assert same == (value == sweep.default)


def test_all_sweeps_share_the_arm_of_the_default():
    names = [v.name for v in sweep_variants()]
    assert names[0] == DEFAULT.name and len(set(names)) == len(names)


def test_flat_is_said_of_what_is_flat():
    said = sentence(ANGLE, points_of(made_up(ANGLE, {10: 19}), ANGLE))
    assert said.startswith(
        "No value changes success (100 % at the default) by more than chance does, from 5 to 40 deg"
    )
    assert "stays between 0.100 and 0.100 m" in said


def test_a_fall_is_said_where_it_is():
    study = made_up(ANGLE, {5: 4, 40: 10}, {40: 0.9})
    said = sentence(ANGLE, points_of(study, ANGLE))
    assert (
        "100 % at the default and no different from 10 to 30 deg; it is 20 % at 5 deg, 50 % at 40 deg."
        in said
    )
    assert said.endswith("0.100 m at 5 deg and 0.900 m at 40 deg.")


def test_yes_and_no_are_values_too():
    assert "it is 25 % at no" in sentence(SPIN, points_of(made_up(SPIN, {False: 5}), SPIN))
    assert "either way" in sentence(SPIN, points_of(made_up(SPIN, {}), SPIN))


def test_wheels_that_a_sweep_changes_reach_the_simulator(tmp_path):
    wheels = next(s for s in SWEEPS if s.slug == "noise-base_ratio").variant(2)
    job = Job("paper/corridor", wheels, 0, "paper", ExplorationConfig(max_scans=2))
    found = run_job(job, tmp_path, keep_record=True, fingerprint=job.fingerprint)
    assert found.summary and found.summary.noise == "custom"
    record = load_record_packed(record_path(tmp_path / job.path))
    assert record.config["simulator"]["noise"]["base_ratio"] == pytest.approx(1.02)
