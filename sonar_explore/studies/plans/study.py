"""`explore-plans`: does exploration end because nothing is left, on buildings that nobody tuned for?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from sonar_explore import __version__
from sonar_explore.config import ExplorationConfig
from sonar_explore.cores import usable_cores
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.episodes.files import writable_folder, write_atomically
from sonar_explore.errors import SonarExploreError, unknown_name
from sonar_explore.slam import SLAMS
from sonar_explore.studies import progress
from sonar_explore.studies.jobs import Job, Outcome, Variant, code_fingerprint
from sonar_explore.studies.plans.buildings import (
    Building,
    buildings_of,
    data_folder,
    generated,
    plan_files,
    readable,
)
from sonar_explore.studies.plans.page import write_pages
from sonar_explore.studies.plans.results import KIND, Miss, PlansStudy, Run, late_s, parts_left
from sonar_explore.studies.plans.tables import BRIEFLY, goal_lines, group_table, growth_table, plan_table
from sonar_explore.studies.plans.tour import kept_tour
from sonar_explore.studies.runner import in_processes, plan, run_jobs
from sonar_explore.studies.store import load_record_packed, record_path


@dataclass(frozen=True)
class PlanChoices:
    """What the command line can choose."""

    data: Path | None
    """Folder of floor plans; None for the environment's, and generated worlds alone where there is none."""
    generated: int
    seeds: int
    noise: str
    slam: str
    whole: bool
    """Whether the plans that are cut are run whole as well."""
    jobs: int | None
    max_scans: int
    out: Path

    @property
    def base(self) -> ExplorationConfig:
        """Of every episode."""
        return replace(ExplorationConfig(), max_scans=self.max_scans)


def run_plans(choices: PlanChoices) -> PlansStudy:
    """Run what is missing, sum up, write tables and pages."""
    noise_preset(choices.noise)
    if choices.slam not in SLAMS:
        raise unknown_name("slam", choices.slam, SLAMS)
    folder = data_folder(choices.data)
    plans, unread = readable(plan_files(folder)) if folder is not None else ({}, [])
    progress.say(*(f"left out: {line}" for line in unread))
    if not plans and not choices.generated:
        raise SonarExploreError("no folder of floor plans and no generated worlds: nothing to run")
    with writable_folder(choices.out):
        worlds, tours = choices.out / "worlds", choices.out / "tours"
        worlds.mkdir(exist_ok=True)
        tours.mkdir(exist_ok=True)
        buildings = list(generated(choices.generated))
        if folder is not None:
            buildings = [*buildings_of(plans, folder, worlds, whole=choices.whole), *buildings]
        outcomes = _run(choices, buildings)
        study = PlansStudy(
            kind=KIND,
            version=__version__,
            code=code_fingerprint(),
            noise=choices.noise,
            slam=choices.slam,
            seeds=choices.seeds,
            max_scans=choices.max_scans,
            unread=unread,
            config=msgspec.to_builtins(choices.base.with_noise(choices.noise)),
            runs=[_summed_up(b, job, outcome, choices.out) for b, job, outcome in outcomes],
        )
        write_atomically(
            choices.out / "results.json", msgspec.json.format(msgspec.json.encode(study), indent=1)
        )
        text = "\n".join(["# Exploration that finishes", "", *report(study), ""])
        write_atomically(choices.out / "table.md", text.encode())
        records = {(job.world, job.seed): choices.out / job.path for _, job, _ in outcomes}
        write_pages(study, choices.out, records)
    progress.show_table(group_table(study).only(BRIEFLY))
    progress.say(*goal_lines(study), f"page: {choices.out / 'index.html'}")
    return study


def report(study: PlansStudy) -> list[str]:
    """Everything but the pictures, in Markdown."""
    return [
        *goal_lines(study),
        "",
        group_table(study).markdown(),
        "",
        plan_table(study).markdown(),
        "",
        growth_table(study).markdown(),
    ]


def _run(choices: PlanChoices, buildings: Sequence[Building]) -> list[tuple[Building, Job, Outcome]]:
    """All episodes, those that are there and those that are missing; small buildings first."""
    arm = Variant(choices.slam, slam=choices.slam)
    pairs = [
        (building, Job(building.world, arm, seed, choices.noise, choices.base))
        for seed in range(choices.seeds)
        for building in sorted(buildings, key=lambda b: b.area_m2)
    ]
    todo = plan([job for _, job in pairs], choices.out, with_record=True)
    if todo.outdated:
        progress.say(
            f"{todo.outdated} finished episodes are of another version or configuration: they run again"
        )
    processes = choices.jobs or usable_cores()
    with progress.bar(len(pairs), len(todo.done)) as on_done:
        fresh = run_jobs(todo.left, choices.out, processes=processes, keep_record=True, on_done=on_done)
    tours = {b.name: (job.world, job.fingerprint, _tour_file(choices.out, b)) for b, job in pairs}
    in_processes(kept_tour, list(tours.values()), processes=processes)
    found = {(o.world, o.seed): o for o in [*todo.done, *fresh]}
    order = {building.world: i for i, building in enumerate(buildings)}
    pairs.sort(key=lambda pair: (order[pair[0].world], pair[1].seed))
    return [(building, job, found[job.world, job.seed]) for building, job in pairs]


def _tour_file(out: Path, building: Building) -> Path:
    return out / "tours" / f"{building.name}.json"


def _summed_up(building: Building, job: Job, outcome: Outcome, out: Path) -> Run:
    tour = kept_tour(job.world, outcome.fingerprint, _tour_file(out, building))
    run = Run(
        building=building.name,
        group=building.group,
        area_m2=building.area_m2,
        world=building.world,
        seed=job.seed,
        summary=outcome.summary,
        error=outcome.error,
        tour_m=tour.length_m,
        decision_s=late_s(outcome.decision_cpu_s),
    )
    if Miss.UNEXPLORED not in run.misses:
        return run
    record = load_record_packed(record_path(out / job.path))
    return msgspec.structs.replace(run, parts=parts_left(record, job.world))
