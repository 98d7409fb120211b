"""`sonar-explore`: the commands together, what there is (worlds, agents), and one line for every failure.

Only click is imported here; everything heavy waits until a command needs it.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from sonar_explore.cores import COLLECT_EVERY
from sonar_explore.episodes.commands import EPISODE_COMMANDS
from sonar_explore.errors import SonarExploreError
from sonar_explore.replay.commands import replay
from sonar_explore.studies.commands import STUDY_COMMANDS

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130  # what shells report for Ctrl-C
EXIT_BROKEN_PIPE = 141  # and for a reader that went away


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; every failure that a user can cause is one line on stderr."""
    gc.set_threshold(COLLECT_EVERY)
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
        # or the interpreter's last flush complains
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE
    except OSError as error:  # a name too long, a disk that went away
        if error.filename is None:
            raise
        return _complain(f"{error.filename}: {error.strerror}")


def _complain(message: str, status: int = EXIT_BAD_INPUT) -> int:
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))
    click.echo(f"sonar-explore: {line}", err=True)
    return status


class _Commands(click.Group):
    """Names its commands when one is unknown, and leaves Ctrl-C and broken pipes to `main`."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command of that name; an error that lists the names where there is none."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            from sonar_explore.errors import unknown_name

            raise unknown_name("command", args[0], self.list_commands(ctx))
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; Ctrl-C goes on as click's abort."""
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


@commands.command(short_help="The worlds that are shipped, and the generators.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def worlds(as_json: bool) -> None:
    """List the worlds that are shipped, and the generators, which make one for every seed."""
    from sonar_explore.envs.generator import generator_names
    from sonar_explore.envs.load import load_world, shipped_worlds

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


@commands.command(short_help="What is read from a world file, and what looks wrong.")
@click.argument("file")
@click.option("--out", type=click.Path(path_type=Path), help="Picture to write: PNG, SVG or PDF.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def world(file: str, out: Path | None, as_json: bool) -> None:
    """Show what is read from FILE, a world file or a name: walls, areas, passages, what looks wrong.

    FILE?resolution=0.02 says how many metres a pixel is, FILE?start=1.5,2,90 where the robot starts.
    """
    from sonar_explore.envs import survey
    from sonar_explore.envs.load import assumed_scale, load_world

    read = load_world(file)
    found = survey.survey(read)
    if out is not None:
        from sonar_explore.envs.plan_picture import save_picture
        from sonar_explore.episodes.files import writable_files

        with writable_files(out):
            save_picture(read, found, out)
    if as_json:
        import json

        click.echo(json.dumps(survey.as_json(read, found)))
        return
    click.echo(survey.as_text(read, found))
    if assumed := assumed_scale(file):
        click.echo(f"  {'scale':16s}{assumed}")
    if out is not None:
        click.echo(f"picture: {out}")


@commands.command(short_help="The exploration policies that are installed.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def agents(as_json: bool) -> None:
    """List the exploration policies that are installed."""
    from sonar_explore.agents import known_agents

    _print_list([{"name": name, "about": about} for name, about in sorted(known_agents().items())], as_json)


for _command in (*EPISODE_COMMANDS, *STUDY_COMMANDS, replay):
    commands.add_command(_command)


def _print_list(rows: list[dict[str, Any]], as_json: bool) -> None:
    if as_json:
        import json

        click.echo(json.dumps(rows))
        return
    from sonar_explore.reports.progress import list_table, print_table

    print_table(list_table([{k: "" if v is None else v for k, v in row.items()} for row in rows]))


if __name__ == "__main__":
    sys.exit(main())
