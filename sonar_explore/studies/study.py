"""What every study of episodes does: run what is missing, sum up, keep what was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sonar_explore.config import ExplorationConfig
from sonar_explore.cores import usable_cores
from sonar_explore.envs.load import load_world
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.episodes.files import writable_folder
from sonar_explore.studies import progress
from sonar_explore.studies.jobs import Outcome, Variant, jobs_of
from sonar_explore.studies.results import Study, save_study, study_of
from sonar_explore.studies.runner import plan, run_jobs


@dataclass(frozen=True)
class Choices:
    """What the command line can choose for every study."""

    seeds: int
    noise: str
    worlds: tuple[str, ...]
    jobs: int | None
    """Processes; None for one a core."""
    max_scans: int | None
    out: Path

    @property
    def base(self) -> ExplorationConfig:
        """Of every arm, before its changes."""
        config = ExplorationConfig()
        return config if self.max_scans is None else replace(config, max_scans=self.max_scans)


def run_variants(kind: str, choices: Choices, variants: Sequence[Variant], *, keep_record: bool) -> Study:
    """Run the episodes that are missing, all of one code and configuration."""
    noise_preset(choices.noise)
    for world in choices.worlds:
        load_world(world)
    jobs = jobs_of(choices.worlds, variants, range(choices.seeds), choices.noise, choices.base)
    with writable_folder(choices.out):
        todo = plan(jobs, choices.out, with_record=keep_record)
        if todo.outdated:
            progress.say(
                f"{todo.outdated} finished episodes were made by another version or with another configuration: "
                "they are run again"
            )
        with progress.bar(len(jobs), len(todo.done)) as on_done:
            fresh: list[Outcome] = run_jobs(
                todo.left,
                choices.out,
                processes=choices.jobs or usable_cores(),
                keep_record=keep_record,
                on_done=on_done,
            )
        study = study_of(
            kind,
            [*todo.done, *fresh],
            worlds=choices.worlds,
            variants=variants,
            seeds=choices.seeds,
            noise=choices.noise,
            base=choices.base,
        )
        save_study(study, choices.out / "results.json")
    return study
