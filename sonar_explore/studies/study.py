"""The three studies: run what is missing, sum up, write tables and pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.world import load_world
from sonar_explore.episodes.files import writable_folder, write_atomically
from sonar_explore.errors import unknown_name
from sonar_explore.slam import SLAMS
from sonar_explore.studies import progress
from sonar_explore.studies.departures import ablation_variants
from sonar_explore.studies.jobs import Outcome, Variant, jobs_of
from sonar_explore.studies.results import Study, save_study, study_of
from sonar_explore.studies.runner import plan, run_jobs, usable_cores
from sonar_explore.studies.sensitivity import points_of, sentence
from sonar_explore.studies.sweeps import SWEEPS, sweep_variants
from sonar_explore.studies.tables import brief_table, goal_lines, pooled_table, table_of


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


def run_reproduction(choices: Choices, arms: Sequence[str]) -> Study:
    """The paper's runs, with and without SLAM."""
    from sonar_explore.reports.study import write_reproduction

    for arm in arms:
        if arm not in SLAMS:
            raise unknown_name("arm", arm, SLAMS)
    study = run_variants("reproduce", choices, [Variant(arm, slam=arm) for arm in arms], keep_record=True)
    goal = goal_lines(study) if "chain" in arms else []
    text = "\n".join(["# The paper's runs", "", *goal, "", table_of(study).markdown(), ""])
    write_atomically(choices.out / "table.md", text.encode())
    write_reproduction(study, choices.out)
    progress.show_table(brief_table(study))
    progress.say(*goal, f"pages: {choices.out / 'index.html'}")
    return study


def run_ablation(choices: Choices) -> Study:
    """Every departure from the paper off alone, and all of them."""
    from sonar_explore.reports.study import write_ablation

    variants = ablation_variants()
    study = run_variants("ablation", choices, variants, keep_record=False)
    table = pooled_table(study, [v.name for v in variants])
    write_atomically(choices.out / "table.md", f"# Ablation\n\n{table.markdown()}\n".encode())
    write_ablation(study, choices.out)
    progress.show_table(table)
    progress.say(f"page: {choices.out / 'index.html'}")
    return study


def run_sensitivity(choices: Choices) -> Study:
    """Each number around its default."""
    from sonar_explore.reports.study import write_sensitivity

    study = run_variants("sensitivity", choices, sweep_variants(), keep_record=False)
    lines = sensitivity_lines(study)
    write_atomically(choices.out / "table.md", "\n".join(["# Sensitivity", "", *lines, ""]).encode())
    write_sensitivity(study, choices.out)
    progress.say(*lines, f"page: {choices.out / 'index.html'}")
    return study


def sensitivity_lines(study: Study) -> list[str]:
    """One sentence a sweep, as a list in Markdown."""
    return [f"- **{s.name}** (`{s.option}`): {sentence(s, points_of(study, s))}" for s in SWEEPS]


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
