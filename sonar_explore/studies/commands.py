"""The commands of the studies. Only click is imported here; everything heavy waits until a command needs it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

PAPER_WORLDS = ("paper/corridor", "paper/bend", "paper/loop", "paper/open-loop", "paper/rooms")
ARMS = ("chain", "off")


def _names(_: click.Context, __: click.Parameter, text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))


def _options(
    kind: str, seeds: int, worlds: tuple[str, ...] = PAPER_WORLDS
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """What all studies can be told."""
    parts = [
        click.option("--seeds", type=click.IntRange(1), default=seeds, show_default=True, help="0 to N - 1."),
        click.option("--noise", default="paper", show_default=True, help="Odometry: paper, ideal or worn."),
        click.option(
            "--worlds", default=",".join(worlds), show_default=True, callback=_names, help="Comma between."
        ),
        click.option("--jobs", type=click.IntRange(1), help="Processes; default: one a core."),
        click.option("--max-scans", type=click.IntRange(1), help="End every episode after this many scans."),
        click.option(
            "--out",
            type=click.Path(path_type=Path),
            default=Path("runs") / kind,
            show_default=True,
            help="Folder; what is finished in it is not run again.",
        ),
    ]

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        for part in reversed(parts):
            command = part(command)
        return command

    return decorated


@click.command()
@_options("reproduce", seeds=100)
@click.option(
    "--arms",
    default=",".join(ARMS),
    show_default=True,
    callback=_names,
    help="Of chain, off, literal, smoothed and truth.",
)
def reproduce(arms: tuple[str, ...], **choices: Any) -> None:
    """Run the paper's worlds with and without SLAM over many seeds; make tables and pages."""
    from sonar_explore.studies.study import Choices, run_reproduction

    run_reproduction(Choices(**choices), arms)


@click.command()
@_options("ablation", seeds=20)
def ablation(**choices: Any) -> None:
    """Turn off every departure from the paper, one at a time."""
    from sonar_explore.studies.study import Choices, run_ablation

    run_ablation(Choices(**choices))


@click.command()
@_options("sensitivity", seeds=10, worlds=("paper/loop", "paper/rooms"))
def sensitivity(**choices: Any) -> None:
    """Sweep the paper's thresholds, the scan and the wheels around their defaults."""
    from sonar_explore.studies.study import Choices, run_sensitivity

    run_sensitivity(Choices(**choices))


@click.command("ring-scan")
@_options("ring-scan", seeds=5)
def ring_scan(**choices: Any) -> None:
    """Compare the ring scan with the paper's: success, accuracy and time."""
    from sonar_explore.studies.ring_scan import run_ring_scan
    from sonar_explore.studies.study import Choices

    run_ring_scan(Choices(**choices))


STUDY_COMMANDS = (reproduce, ablation, sensitivity, ring_scan)
