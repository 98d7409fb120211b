"""The comparison: record and replay what is missing, sum up, write tables and the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import msgspec

from sonar_explore.cores import usable_cores
from sonar_explore.envs.load import load_world
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.episodes.files import writable_folder, write_atomically
from sonar_explore.studies import progress
from sonar_explore.studies.compare.jobs import (
    ORACLE,
    REPLAYED,
    DriveJob,
    DriveOutcome,
    drive_jobs,
    finished_drive,
    run_drive,
)
from sonar_explore.studies.compare.page import write_comparison
from sonar_explore.studies.compare.results import Comparison, comparison_of
from sonar_explore.studies.compare.tables import brief_table, comparison_lines, goal_lines
from sonar_explore.studies.jobs import Variant
from sonar_explore.studies.results import Row
from sonar_explore.studies.runner import in_processes
from sonar_explore.studies.study import Choices, run_variants


def run_comparison(choices: Choices, closed_loop_seeds: int = 0) -> Comparison:
    """Every SLAM on the same drives, and in the loop where asked."""
    noises = tuple(dict.fromkeys(name.strip() for name in choices.noise.split(",") if name.strip()))
    for noise in noises:
        noise_preset(noise)
    for world in choices.worlds:
        load_world(world)
    with writable_folder(choices.out):
        outcomes = _drives(choices, drive_jobs(choices.worlds, noises, choices.seeds, choices.base))
        closed = {n: _closed_loop(choices, n, closed_loop_seeds) for n in noises if closed_loop_seeds}
        found = comparison_of(
            outcomes,
            worlds=choices.worlds,
            noises=noises,
            seeds=choices.seeds,
            base=choices.base,
            closed_loop_seeds=closed_loop_seeds,
            closed_loop=closed,
        )
        content = msgspec.json.format(msgspec.json.encode(found), indent=1)
        write_atomically(choices.out / "results.json", content)
        text = "\n".join(["# Comparison", "", *comparison_lines(found), ""])
        write_atomically(choices.out / "table.md", text.encode())
        write_comparison(found, outcomes, choices.out)
    for noise in noises:
        progress.show_table(brief_table(found, noise))
    progress.say(*goal_lines(found, noises[0]), *found.errors, f"page: {choices.out / 'index.html'}")
    return found


def _drives(choices: Choices, jobs: Sequence[DriveJob]) -> list[DriveOutcome]:
    looked = [(job, *finished_drive(job, choices.out)) for job in jobs]
    done = [outcome for _, outcome, current in looked if outcome and current]
    left = [job for job, _, current in looked if not current]
    outdated = sum(outcome is not None and not current for _, outcome, current in looked)
    if outdated:
        progress.say(f"{outdated} drives were made by another version or configuration: they are run again")
    calls = [(job, choices.out, job.fingerprint) for job in left]
    with progress.bar(len(jobs), len(done), _words, "drives") as on_done:
        fresh = in_processes(run_drive, calls, processes=choices.jobs or usable_cores(), on_done=on_done)
    order = {(job.world, job.noise, job.seed): i for i, job in enumerate(jobs)}
    return sorted([*done, *fresh], key=lambda o: order[o.world, o.noise, o.seed])


def _words(outcome: DriveOutcome) -> str:
    errors = {name: arm.position_error_m.mean for name, arm in outcome.arms.items()}
    shown = ", ".join(
        f"{name} {errors[name]:.3f} m" for name in ("chain", "smoothed", ORACLE) if name in errors
    )
    return f"{outcome.world} {outcome.noise} {outcome.seed}: {outcome.error or shown}"


def _closed_loop(choices: Choices, noise: str, seeds: int) -> list[Row]:
    """Success of whole explorations with each SLAM in the loop."""
    here = replace(choices, noise=noise, seeds=seeds, out=choices.out / "closed-loop" / noise)
    variants = [Variant(name, slam=name) for name in REPLAYED]
    return run_variants("compare", here, variants, keep_record=False).rows
