"""The commands of the studies. Only click is imported here; everything heavy waits until a command needs it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from sonar_explore.choices import SLAMS, WholeNumber

PAPER_WORLDS = ("paper/corridor", "paper/bend", "paper/loop", "paper/open-loop", "paper/rooms")
ARMS = ("chain", "off")


def _names(_: click.Context, __: click.Parameter, text: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise click.BadParameter("no name; give one or more, comma between")
    return names


def _options(
    kind: str, seeds: int, worlds: tuple[str, ...] = PAPER_WORLDS, noise: str = "paper"
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """What all studies can be told."""
    parts = [
        click.option("--seeds", type=WholeNumber(1), default=seeds, show_default=True, help="0 to N - 1."),
        click.option("--noise", default=noise, show_default=True, help="Odometry: paper, ideal or worn."),
        click.option(
            "--worlds", default=",".join(worlds), show_default=True, callback=_names, help="Comma between."
        ),
        click.option("--jobs", type=WholeNumber(1), help="Processes; default: one a core."),
        click.option("--max-scans", type=WholeNumber(1), help="End every episode after this many scans."),
        click.option(
            "--out",
            type=click.Path(path_type=Path),
            default=Path("runs") / kind,
            show_default=True,
            help="Folder; what is finished in it is not run again.",
        ),
    ]

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        """The command with all of them, in this order on its help page."""
        for part in reversed(parts):
            command = part(command)
        return command

    return decorated


@click.command(short_help="The paper's worlds with and without SLAM, many seeds.")
@_options("reproduce", seeds=100)
@click.option(
    "--arms",
    default=",".join(ARMS),
    show_default=True,
    callback=_names,
    help="Of " + ", ".join(SLAMS) + ".",
)
def reproduce(arms: tuple[str, ...], **choices: Any) -> None:
    """Run the paper's worlds with and without SLAM over many seeds; make tables and pages."""
    from sonar_explore.studies.reproduce import run_reproduction
    from sonar_explore.studies.study import Choices

    run_reproduction(Choices(**choices), arms)


@click.command(short_help="Every departure from the paper off alone.")
@_options("ablation", seeds=20)
def ablation(**choices: Any) -> None:
    """Turn off every departure from the paper, one at a time."""
    from sonar_explore.studies.ablation import run_ablation
    from sonar_explore.studies.study import Choices

    run_ablation(Choices(**choices))


@click.command(short_help="Thresholds, scan and wheels swept around their defaults.")
@_options("sensitivity", seeds=10, worlds=("paper/loop", "paper/rooms"))
def sensitivity(**choices: Any) -> None:
    """Sweep the paper's thresholds, the scan and the wheels around their defaults."""
    from sonar_explore.studies.sensitivity import run_sensitivity
    from sonar_explore.studies.study import Choices

    run_sensitivity(Choices(**choices))


@click.command("ring-scan", short_help="The ring scan beside the paper's.")
@_options("ring-scan", seeds=5)
def ring_scan(**choices: Any) -> None:
    """Compare the ring scan with the paper's: success, accuracy and time."""
    from sonar_explore.studies.ring_scan import run_ring_scan
    from sonar_explore.studies.study import Choices

    run_ring_scan(Choices(**choices))


@click.command("explore-plans", short_help="Floor plans and generated worlds: what is left, and why.")
@click.argument("data", required=False, type=click.Path(path_type=Path))
@click.option("--generated", type=WholeNumber(0), default=200, show_default=True, help="Generated worlds.")
@click.option("--seeds", type=WholeNumber(1), default=1, show_default=True, help="0 to N - 1.")
@click.option("--noise", default="paper", show_default=True, help="Odometry: paper, ideal or worn.")
@click.option("--slam", default="smoothed", show_default=True, help="What corrects the pose.")
@click.option("--whole", is_flag=True, help="Run the plans above 400 m2 whole as well.")
@click.option("--jobs", type=WholeNumber(1), help="Processes; default: one a core.")
@click.option(
    "--max-scans",
    type=WholeNumber(1),
    default=4000,
    show_default=True,
    help="End every episode after this many.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("runs/explore-plans"),
    show_default=True,
    help="Folder; what is finished in it is not run again.",
)
def explore_plans(**choices: Any) -> None:
    """Explore every floor plan below the folder DATA, and generated worlds; say what was left out and why.

    DATA is by default the folder plans/ of SONAR_EXPLORE_DATA; where that is not set, generated worlds alone are run.
    Plans above 400 m2 are cut; those with no furnished version get clutter as well.
    """
    from sonar_explore.studies.plans.study import PlanChoices, run_plans

    run_plans(PlanChoices(**choices))


@click.command(short_help="Every SLAM on the same drives, beside an oracle.")
@_options("compare", seeds=100, noise="paper,worn")
@click.option(
    "--closed-loop-seeds",
    type=WholeNumber(0),
    default=0,
    show_default=True,
    help="Also explore with each SLAM in the loop, seeds 0 to N - 1.",
)
def compare(closed_loop_seeds: int, **choices: Any) -> None:
    """Feed the same recorded drives to every SLAM and to an oracle; --noise takes several, comma between."""
    from sonar_explore.studies.compare.study import run_comparison
    from sonar_explore.studies.study import Choices

    run_comparison(Choices(**choices), closed_loop_seeds)


@click.command("real-sonar", short_help="Extraction and SLAM on recorded sonar.")
@click.argument("data", type=click.Path(path_type=Path))
@click.option("--seeds", type=WholeNumber(1), default=10, show_default=True, help="Odometries a run.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("runs/real-sonar"),
    show_default=True,
    help="Folder.",
)
@click.option("--docs", type=click.Path(path_type=Path), help="Page whose tables and pictures are made anew.")
def real_sonar(data: Path, seeds: int, out: Path, docs: Path | None) -> None:
    """Judge extraction and SLAM on the recorded sonar in DATA (docs/real_sonar.md)."""
    from sonar_explore.episodes.files import writable_folder
    from sonar_explore.studies.real_sonar.page import put_into_docs, write_real_sonar
    from sonar_explore.studies.real_sonar.study import study_real_sonar

    with writable_folder(out):
        found = study_real_sonar(data, seeds)
        write_real_sonar(found, out)
        if docs is not None:
            put_into_docs(found, docs)
    click.echo(f"page: {out / 'index.html'}")


STUDY_COMMANDS = (reproduce, ablation, sensitivity, ring_scan, explore_plans, compare, real_sonar)
