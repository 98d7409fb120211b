"""`sonar-explore`: run an episode, list worlds and agents, make a report again.

Only click is imported here; everything heavy waits until a command needs it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonar_explore.choices import SLAMS
from sonar_explore.errors import SonarExploreError
from sonar_explore.replay.commands import real_sonar, replay
from sonar_explore.studies.commands import STUDY_COMMANDS

if TYPE_CHECKING:
    from sonar_explore.config import ExplorationConfig
    from sonar_explore.episodes.record import EpisodeRecord, StepRecord
    from sonar_explore.replay.log import Recorder

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130  # what shells report for Ctrl-C
EXIT_BROKEN_PIPE = 141  # and for a reader that went away
SEED_MAX = 2**32 - 1
NOT_IN_A_NAME = "?&=:/\\"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; every failure that a user can cause is one line on stderr."""
    try:
        status = commands.main(arguments, prog_name="sonar-explore", standalone_mode=False)
        sys.stdout.flush()
        return status if isinstance(status, int) else 0  # an int is click's own, after --help and the like
    except SonarExploreError as error:
        return _complain(str(error))
    except click.ClickException as error:
        return _complain(error.format_message())
    except (KeyboardInterrupt, click.Abort):
        return _complain("interrupted", EXIT_INTERRUPTED)
    except BrokenPipeError:
        os.dup2(
            os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
        )  # or the interpreter's last flush complains
        return EXIT_BROKEN_PIPE


def _complain(message: str, status: int = EXIT_BAD_INPUT) -> int:
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))
    click.echo(f"sonar-explore: {line}", err=True)
    return status


class _Commands(click.Group):
    """Names its commands when one is unknown, and leaves Ctrl-C and broken pipes to `main`."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            from sonar_explore.errors import unknown_name

            raise unknown_name("command", args[0], self.list_commands(ctx))
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise click.Abort from error  # click itself would print an empty line first


def _version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        click.echo(f"sonar-explore {version('sonar-explore')}")
        ctx.exit()


@click.group(
    cls=_Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Show the version."
)
@click.pass_context
def commands(ctx: click.Context) -> None:
    """A simulated robot with nothing but sonar explores an unknown building."""
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


@commands.command()
@click.argument("world")
@click.option("--agent", default="frontier", show_default=True, help="Policy: a known name, or module:Name.")
@click.option(
    "--slam", type=click.Choice(SLAMS), default="chain", show_default=True, help="What corrects the pose."
)
@click.option("--noise", default="paper", show_default=True, help="Odometry: paper, ideal or worn.")
@click.option(
    "--seed", type=click.IntRange(0, SEED_MAX), default=0, show_default=True, help="Of world and robot."
)
@click.option("--out", type=click.Path(path_type=Path), help="Folder for episode.json and report.html.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object, nothing else.")
@click.option("--max-scans", type=click.IntRange(1), help="End after this many scans.")
@click.option(
    "--scan",
    type=click.Choice(("turn", "ring")),
    default="turn",
    show_default=True,
    help="A full turn with one sonar, or a short one with all.",
)
@click.option(
    "--sensor",
    type=click.Choice(("amigobot", "nxt")),
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
    from sonar_explore.episodes.files import save_record, writable_folder

    folder = out or default_folder(world, agent, slam, noise, seed, scan)
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
        click.echo(f"report: {report_file}")


@commands.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def worlds(as_json: bool) -> None:
    """List the worlds that are shipped, and the generators, which make one for every seed."""
    from sonar_explore.envs.generator import generator_names
    from sonar_explore.envs.world import load_world, shipped_worlds

    rows: list[dict[str, Any]] = [
        {
            "name": world.name,
            "title": world.title,
            "walls": len(world.walls),
            "loop": bool(world.has_loop),
        }
        for world in map(load_world, shipped_worlds())
    ]
    for name in generator_names():
        title = f"{load_world(name).title}; with any seed, as {name}-17"
        rows.append({"name": name, "title": title, "walls": None, "loop": None})
    _print_list(rows, as_json)


@commands.command()
@click.argument("file")
@click.option("--out", type=click.Path(path_type=Path), help="Picture to write: PNG, SVG or PDF.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def world(file: str, out: Path | None, as_json: bool) -> None:
    """Show what is read from FILE, a world file or a name: walls, areas, passages, what looks wrong.

    FILE?resolution=0.02 says how many metres a pixel is, FILE?start=1.5,2,90 where the robot starts.
    """
    from sonar_explore.envs import survey
    from sonar_explore.envs.world import load_world

    read = load_world(file)
    found = survey.survey(read)
    if out is not None:
        from sonar_explore.envs.plan_picture import save_picture

        save_picture(read, found, out)
    if as_json:
        import json

        click.echo(json.dumps(survey.as_json(read, found)))
        return
    click.echo(survey.as_text(read, found))
    if out is not None:
        click.echo(f"picture: {out}")


@commands.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def agents(as_json: bool) -> None:
    """List the exploration policies that are installed."""
    from sonar_explore.agents import known_agents

    _print_list([{"name": name, "about": about} for name, about in sorted(known_agents().items())], as_json)


@commands.command()
@click.argument("episode", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Page to write; default: report.html beside EPISODE."
)
def report(episode: Path, out: Path | None) -> None:
    """Make the report of EPISODE, an episode.json, again."""
    from sonar_explore.episodes.files import load_record

    page = out or episode.with_name("report.html")
    _report(load_record(episode), page)
    click.echo(f"report: {page}")


@commands.command()
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
    from sonar_explore.episodes.export import write_ros_map, write_trajectory
    from sonar_explore.episodes.files import load_record
    from sonar_explore.reports.raster import grid_states

    if tum is None and truth is None and map_name is None:
        raise SonarExploreError("say what to export: --tum FILE, --truth FILE, --map NAME")
    record = load_record(episode)
    states = grid_states(record.grid)
    for path, true in ((tum, False), (truth, True)):
        if path is not None:
            write_trajectory(record, path, true=true)
            click.echo(f"trajectory: {path}")
    if map_name is not None:
        settings, image = write_ros_map(record, map_name, states)
        click.echo(f"map: {settings}, {image}")


for _command in (*STUDY_COMMANDS, replay, real_sonar):
    commands.add_command(_command)


def default_folder(world: str, agent: str, slam: str, noise: str, seed: int, scan: str = "turn") -> Path:
    """`runs/<world>-<agent>-<slam>-<noise>[-ring]-<seed>`, one folder deep whatever the world is called."""
    parts = (world, agent, slam, noise, *(() if scan == "turn" else (scan,)), str(seed))
    name = "-".join(parts)
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
    from sonar_explore.episodes.run import run_episode

    extra: dict[str, Any] = {} if recorder is None else {"recorder": recorder}
    with _progress(quiet) as on_step:
        return run_episode(world, agent, slam, noise, seed, config=config, on_step=on_step, **extra)


@contextmanager
def _recorder(log: Path | None, sensor: str) -> Iterator[Recorder | None]:
    """Notes down what is measured, and writes it once the run is over; None where nobody wants it."""
    if log is None:
        yield None
        return
    from sonar_explore.episodes.files import writable_folder
    from sonar_explore.replay.files import write_log
    from sonar_explore.replay.log import Recorder

    recorder = Recorder(sensor)
    with writable_folder(log.parent):
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
    from sonar_explore.reports.progress import summary_table

    _print_table(summary_table(record.summary))


def _print_list(rows: list[dict[str, Any]], as_json: bool) -> None:
    if as_json:
        import json

        click.echo(json.dumps(rows))
        return
    from sonar_explore.reports.progress import list_table

    _print_table(list_table([{k: "" if v is None else v for k, v in row.items()} for row in rows]))


def _print_table(table: Any) -> None:
    from rich.console import Console

    Console(highlight=False, markup=False).print(table)


if __name__ == "__main__":
    sys.exit(main())
