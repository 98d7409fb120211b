"""A whole episode: what it records, that it can be repeated, and that policies cannot break it."""

import json
import math
import subprocess
import sys
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from sonar_explore.agents import Decision, Score
from sonar_explore.agents.frontier import FrontierPolicy
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.episodes.files import load_record, save_record
from sonar_explore.episodes.record import EpisodeRecord, StepRecord
from sonar_explore.episodes.run import run_episode
from sonar_explore.errors import SonarExploreError
from sonar_explore.mapping.grid import GridFrame, window
from sonar_explore.reports.raster import grid_states

SHORT = ExplorationConfig(max_scans=8)


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return run_episode("paper/corridor", seed=2, config=SHORT)


def in_a_process(folder, world: str, seed: int) -> dict:
    command = [sys.executable, "-m", "sonar_explore.cli", "run", world, "--seed", str(seed)]
    subprocess.run([*command, "--max-scans", "8", "--out", folder, "--json"], check=True, capture_output=True)
    return json.loads((folder / "episode.json").read_bytes())


def test_the_same_seed_gives_the_same_bytes_in_two_processes(tmp_path):
    first, second = (in_a_process(tmp_path / name, "paper/rooms", 5) for name in ("a", "b"))
    for episode in (first, second):
        assert episode["summary"].pop("wall_time_s") > 0.0
    assert json.dumps(first) == json.dumps(second)


def test_another_seed_gives_another_episode(record):
    other = run_episode("paper/corridor", seed=3, config=SHORT)
    assert other.steps[0].scan_ranges_m != record.steps[0].scan_ranges_m


def test_a_policy_does_not_change_the_luck_of_the_robot(record):
    other = run_episode("paper/corridor", "random", seed=2, config=SHORT)
    assert other.steps[0].scan_ranges_m == record.steps[0].scan_ranges_m


def test_steps_are_numbered_and_told_as_they_are_made(record):
    told: list[StepRecord] = []
    again = run_episode("paper/corridor", seed=2, config=SHORT, on_step=told.append)
    assert told == again.steps == record.steps
    assert [step.index for step in told] == list(range(len(told)))


def test_the_changes_of_the_map_laid_over_each_other_are_the_map_at_every_scan(record):
    maps = []

    class Watching(FrontierPolicy):
        def choose(self, situation):
            maps.append(situation.grid)
            return super().choose(situation)

    run_episode("paper/corridor", Watching(), seed=2, config=SHORT)
    frame = GridFrame(*record.grid.origin, record.grid.resolution_m, record.grid.shape)
    laid = np.zeros(frame.shape, np.uint8)
    for k, step in enumerate(record.steps):
        if step.map_change:
            part = step.map_change
            row, column = frame.cell(part.origin[0] + 0.01, part.origin[1] + 0.01)
            laid[row : row + part.shape[0], column : column + part.shape[1]] = grid_states(part)
        if k < len(maps):
            assert (laid == window(maps[k].frame, maps[k].states, frame)).all()
    assert len(maps) == len(record.steps) - 1
    assert (laid == grid_states(record.grid)).all()


def test_the_summary_agrees_with_the_steps(record):
    summary, steps = record.summary, record.steps
    assert summary.scans == len(steps) == 8
    assert summary.decisions == sum(step.decision is not None for step in steps) == 7
    assert summary.end_reason == "scan_limit"
    assert summary.explored_fraction == steps[-1].explored_fraction
    assert summary.chains == len(record.chains)
    final = np.hypot(*(np.array(steps[-1].pose[:2]) - steps[-1].true_pose[:2]))
    assert summary.position_error_m.final == pytest.approx(final, abs=1e-5)


def test_time_way_and_explored_area_never_shrink(record):
    for name in ("sim_time_s", "path_length_m", "explored_fraction"):
        values = [getattr(step, name) for step in record.steps]
        assert values == sorted(values)


def test_every_decision_is_recorded_with_the_score_of_every_candidate(record):
    for step in record.steps[:-1]:
        decision = step.decision
        assert 0 <= decision.chosen < len(decision.candidates)
        for candidate in decision.candidates:
            assert sum(candidate.terms.values()) == pytest.approx(candidate.score, abs=1e-5)


def test_the_record_survives_the_file(record, tmp_path):
    save_record(record, tmp_path / "episode.json")
    again = load_record(tmp_path / "episode.json")
    assert msgspec.json.encode(again) == msgspec.json.encode(record)


def test_the_record_says_with_what_it_was_made(record):
    assert record.config["max_scans"] == 8
    assert record.config["simulator"]["noise"]["wheel_ratio"] == 1.003


def test_with_no_errors_and_no_slam_the_robot_knows_where_it_is():
    ideal = run_episode("paper/corridor", slam="off", noise="ideal", config=SHORT)
    assert ideal.summary.position_error_m.max < 1e-5
    assert ideal.summary.heading_error_deg.max < 1e-4


def test_a_known_pose_is_never_wrong():
    known = run_episode("paper/corridor", slam="truth", noise="worn", config=SHORT)
    assert known.summary.position_error_m.max < 1e-5


def test_the_environment_decides_alike_whoever_drives_it(record):
    """A loop through `step` with the recorded choices is the recorded episode."""
    env = ExplorationEnv("paper/corridor", config=SHORT)
    env.reset(seed=2)
    for step in record.steps[:-1]:
        *_, info = env.step(np.int64(step.decision.chosen))
    assert info["truth"]["explored_fraction"] == pytest.approx(record.summary.explored_fraction, abs=1e-6)
    assert info["end_reason"] == record.summary.end_reason


def test_without_a_preset_the_noise_is_the_configuration_s_own():
    worn = run_episode("paper/corridor", slam="off", noise=None, config=SHORT.with_noise("worn"))
    named = run_episode("paper/corridor", slam="off", noise="worn", config=SHORT)
    assert worn.summary.noise == "worn"
    assert worn.steps == named.steps


def test_the_seed_draws_the_world_of_a_generator():
    drawn = [run_episode("generated/hall", seed=s, config=replace(SHORT, max_scans=1)) for s in (0, 1, 0)]
    names = [record.summary.world for record in drawn]
    assert names[0] == names[2] != names[1]
    again = run_episode(names[1], config=replace(SHORT, max_scans=1))
    assert again.world.walls == drawn[1].world.walls


class Constant:
    """Chooses the same number, whatever is offered."""

    def __init__(self, chosen: int, short: int = 0) -> None:
        self.chosen, self.short = chosen, short

    def choose(self, situation):
        return Decision(self.chosen, (Score({}),) * (len(situation.candidates) - self.short))


@pytest.mark.parametrize("policy", [Constant(999), Constant(-1), Constant(0, short=1)])
def test_a_policy_that_chooses_what_is_not_there_is_an_error(policy):
    with pytest.raises(SonarExploreError, match="candidate"):
        run_episode("paper/corridor", policy)


class Silent:
    """Forgets to return its decision."""

    def choose(self, situation):
        Decision(0, (Score({}),) * len(situation.candidates))


def test_a_policy_that_decides_nothing_is_an_error_that_says_so():
    with pytest.raises(SonarExploreError, match="returned None; it must return a Decision"):
        run_episode("paper/corridor", Silent())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"world": "paper/moon"}, "paper/corridor"),
        ({"agent": "nobody"}, "frontier"),
        ({"slam": "magic"}, "chain, grid-pf, literal, off, scan-match, smoothed, truth"),
        ({"noise": "loud"}, "ideal, paper, worn"),
        ({"seed": -1}, "out of range"),
        ({"seed": 2**32}, "out of range"),
    ],
)
def test_a_wrong_argument_is_one_line_that_names_what_is_possible(arguments, words):
    with pytest.raises(SonarExploreError, match=words) as error:
        run_episode(**{"world": "paper/corridor", **arguments})
    assert "\n" not in str(error.value)


def test_configurations_are_values():
    assert replace(SHORT, max_scans=400) == ExplorationConfig()
    assert SHORT.with_noise("worn").simulator.noise.wheel_ratio == 1.01


@pytest.mark.parametrize("seed", [60, 94])  # open without the drives that close loops
def test_the_robot_goes_on_round_a_loop_until_it_meets_the_walls_of_its_first_scan(seed):
    summary = run_episode("paper/loop", seed=seed).summary
    assert summary.loop_closed and summary.end_reason == "explored"


def test_where_a_policy_fails_its_line_is_named():
    class Fails:
        def choose(self, situation):
            raise KeyError("mine")

    with pytest.raises(
        SonarExploreError, match=r"choose failed at .*test_run\.py line \d+: KeyError: 'mine'"
    ):
        run_episode("paper/corridor", Fails())


def test_a_score_that_is_no_number_is_an_error():
    class Nan:
        def choose(self, situation):
            return Decision.best([Score({"gain": math.nan}) for _ in situation.candidates])

    with pytest.raises(SonarExploreError, match="every term must be finite"):
        run_episode("paper/corridor", Nan())
