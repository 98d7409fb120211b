"""The commands of an episode: run, report, export. Only click is imported here, as in `cli`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonar_explore.choices import SLAMS, Named, WholeNumber
from sonar_explore.errors import SonarExploreError

if TYPE_CHECKING:
    from sonar_explore.config import ExplorationConfig
    from sonar_explore.episodes.record import EpisodeRecord, StepRecord
    from sonar_explore.replay.log import Recorder

SEED_MAX = 2**32 - 1
NOT_IN_A_NAME = "?&=:/\\"


@click.command(short_help="Explore WORLD, and report on it.")
@click.argument("world")
@click.option("--agent", default="frontier", show_default=True, help="Policy: a known name, or module:Name.")
@click.option(
    "--slam", type=Named("slam", SLAMS), default="chain", show_default=True, help="What corrects the pose."
)
@click.option("--noise", default="paper", show_default=True, help="Odometry: paper, ideal or worn.")
@click.option(
    "--seed", type=WholeNumber(0, SEED_MAX), default=0, show_default=True, help="Of world and robot."
)
@click.option("--out", type=click.Path(path_type=Path), help="Folder for episode.json and report.html.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object, nothing else.")
@click.option("--max-scans", type=WholeNumber(1), help="End after this many scans.")
@click.option(
    "--scan",
    type=Named("scan", ("turn", "ring")),
    default="turn",
    show_default=True,
    help="A full turn on the spot, or one of 70 degrees.",
)
@click.option(
    "--sensor",
    type=Named("sensor", ("amigobot", "nxt")),
    default="amigobot",
    show_default=True,
    help="The AmigoBot's sonar, or a cheap one.",
)
@click.option("--log", type=click.Path(path_type=Path), help="Keep what was measured, for `replay`.")
def run(
    world: str,
    agent: str,
    slam: str,
    noise: str,
    seed: int,
    out: Path | None,
    as_json: bool,
    max_scans: int | None,
    scan: str,
    sensor: str,
    log: Path | None,
) -> None:
    """Explore WORLD, a name or a world file, and report on it."""
    from sonar_explore.envs.load import assumed_scale
    from sonar_explore.episodes.files import save_record, writable_folder

    chosen = _not_default(scan, sensor, max_scans)
    folder = out or default_folder(_named(world, seed), agent, slam, noise, seed, *chosen)
    with writable_folder(folder):
        config = _config(max_scans, scan, sensor)
        with _recorder(log, sensor) as recorder:
            record = _explore(world, agent, slam, noise, seed, config, recorder, quiet=as_json)
        save_record(record, folder / "episode.json")
        report_file = folder / "report.html"
        _report(record, report_file)
    if as_json:
        import msgspec

        click.echo(msgspec.json.encode(record.summary).decode())
    else:
        _print_summary(record)
        if assumed := assumed_scale(world):
            click.echo(f"scale: {assumed}")
        click.echo(f"report: {report_file}")
        if log is not None:
            click.echo(f"log: {log}")


@click.command(short_help="Make the report of an episode again.")
@click.argument("episode", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Page to write; default: report.html beside EPISODE."
)
def report(episode: Path, out: Path | None) -> None:
    """Make the report of EPISODE, an episode.json, again."""
    from sonar_explore.episodes.files import load_record, writable_files

    page = out or episode.with_name("report.html")
    record = load_record(episode)
    with writable_files(page):
        _report(record, page)
    click.echo(f"report: {page}")


@click.command(short_help="An episode as TUM trajectories and a ROS map.")
@click.argument("episode", type=click.Path(path_type=Path))
@click.option(
    "--tum", type=click.Path(path_type=Path), help="TUM trajectory to write: the believed poses of the scans."
)
@click.option("--truth", type=click.Path(path_type=Path), help="TUM trajectory to write: the true ones.")
@click.option(
    "--map", "map_name", type=click.Path(path_type=Path), help="ROS map to write: NAME.yaml and NAME.pgm."
)
def export(episode: Path, tum: Path | None, truth: Path | None, map_name: Path | None) -> None:
    """Write EPISODE, an episode.json, in formats of others: TUM trajectories, a ROS map."""
    from sonar_explore.episodes.export import ros_map_files, write_ros_map, write_trajectory
    from sonar_explore.episodes.files import load_record, writable_files
    from sonar_explore.reports.raster import grid_states

    if tum is None and truth is None and map_name is None:
        raise SonarExploreError("say what to export: --tum FILE, --truth FILE, --map NAME")
    if tum is not None and tum == truth:
        raise SonarExploreError(f"--tum and --truth both name {tum}; give each a file of its own")
    record = load_record(episode)
    states = grid_states(record.grid)
    maps = ros_map_files(map_name) if map_name else ()
    with writable_files(*(file for file in (tum, truth) if file), *maps):
        for path, true in ((tum, False), (truth, True)):
            if path is not None:
                write_trajectory(record, path, true=true)
                click.echo(f"trajectory: {path}")
        if map_name is not None:
            settings, image = write_ros_map(record, map_name, states)
            click.echo(f"map: {settings}, {image}")


def _not_default(scan: str, sensor: str, max_scans: int | None) -> tuple[str, ...]:
    """What else was chosen, for the name of the folder: another choice is another run."""
    scans = () if max_scans is None else (f"{max_scans}-scans",)
    return tuple(name for name in (scan, sensor) if name not in ("turn", "amigobot")) + scans


def _named(world: str, seed: int) -> str:
    """The world as its folder is called: where the seed draws one, the one drawn. The same world under its own name
    is another run: there the seed is the robot's alone."""
    from sonar_explore.envs.load import drawn_name, is_generator

    return f"{drawn_name(world, seed)}-drawn" if is_generator(world) else world


def default_folder(world: str, agent: str, slam: str, noise: str, seed: int, *chosen: str) -> Path:
    """`runs/<world>-<agent>-<slam>-<noise>[-ring][-nxt][-9-scans]-<seed>`, one folder whatever the world is called."""
    name = "-".join((world, agent, slam, noise, *chosen, str(seed)))
    return Path("runs") / "".join("-" if c in NOT_IN_A_NAME else c for c in name.strip("/."))


def _explore(
    world: str,
    agent: str,
    slam: str,
    noise: str,
    seed: int,
    config: ExplorationConfig | None,
    recorder: Recorder | None,
    *,
    quiet: bool,
) -> EpisodeRecord:
    from sonar_explore.compile_beside import compiling_beside
    from sonar_explore.episodes.run import run_episode

    extra: dict[str, Any] = {} if recorder is None else {"recorder": recorder}
    if ":" in agent and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # a policy that lies in the working folder is found as well
    with _progress(quiet) as on_step, compiling_beside():
        return run_episode(world, agent, slam, noise, seed, config=config, on_step=on_step, **extra)


@contextmanager
def _recorder(log: Path | None, sensor: str) -> Iterator[Recorder | None]:
    """Notes down what is measured, and writes it once the run is over; None where nobody wants it."""
    if log is None:
        yield None
        return
    from sonar_explore.episodes.files import writable_files
    from sonar_explore.replay.files import write_log
    from sonar_explore.replay.log import Recorder

    recorder = Recorder(sensor)
    with writable_files(log):
        yield recorder
        write_log(recorder.log, log)


def _config(max_scans: int | None, scan: str, sensor: str) -> ExplorationConfig | None:
    """The runner's configuration, None for its defaults."""
    if (max_scans, scan, sensor) == (None, "turn", "amigobot"):
        return None
    from sonar_explore.config import ExplorationConfig

    config = ExplorationConfig(scan=scan)
    config = config if sensor == "amigobot" else config.with_sensor(sensor)
    return config if max_scans is None else replace(config, max_scans=max_scans)


def _report(record: EpisodeRecord, page: Path) -> None:
    from sonar_explore.reports.episode import write_episode_report

    write_episode_report(record, page)


def _progress(quiet: bool) -> AbstractContextManager[Callable[[StepRecord], None]]:
    """A live line on stderr, or nothing where nobody reads it."""
    from contextlib import nullcontext

    if quiet or not sys.stderr.isatty():
        return nullcontext(lambda _: None)
    from sonar_explore.reports.progress import live_line

    return live_line()


def _print_summary(record: EpisodeRecord) -> None:
    from sonar_explore.reports.progress import print_table, summary_table

    print_table(summary_table(record.summary))


EPISODE_COMMANDS = (run, report, export)
