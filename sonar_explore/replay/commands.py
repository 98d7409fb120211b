"""`sonar-explore replay`. Only click is imported here; everything heavy waits until the command runs."""

from __future__ import annotations

from pathlib import Path

import click

from sonar_explore.choices import SLAMS, Named


@click.command(short_help="SLAM on recorded scans: a log of ours or of others.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option(
    "--slam", type=Named("slam", SLAMS), default="chain", show_default=True, help="What corrects the pose."
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder for replay.json and replay.html.  [default: runs/replay-SLAM]",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array, nothing else.")
def replay(files: tuple[Path, ...], slam: str, out: Path | None, as_json: bool) -> None:
    """Run SLAM on recorded scans: FILE... is a log of ours, or scans as others keep them (docs/replay.md)."""
    import msgspec

    from sonar_explore.episodes.files import writable_folder, write_atomically
    from sonar_explore.replay.layouts import read_logs
    from sonar_explore.replay.play import as_builtins, headline, replay
    from sonar_explore.reports.replay import write_replay_page

    logs = read_logs(files)
    out = out or Path("runs") / f"replay-{slam}"
    with writable_folder(out):
        done = [replay(log, slam) for log in logs]
        found = [as_builtins(one) for one in done]
        write_atomically(out / "replay.json", msgspec.json.encode(found))
        write_replay_page(done, out / "replay.html")
    if as_json:
        click.echo(msgspec.json.encode(found).decode())
        return
    for one in done:
        click.echo(headline(one))
    click.echo(f"page: {out / 'replay.html'}")
