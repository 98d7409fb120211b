"""`sonar-explore replay`. Only click is imported here; everything heavy waits until the command runs."""

from __future__ import annotations

from pathlib import Path

import click

from sonar_explore.choices import SLAMS


@click.command("real-sonar", short_help="Extraction and SLAM on recorded sonar.")
@click.argument("data", type=click.Path(path_type=Path))
@click.option("--seeds", type=click.IntRange(1), default=10, show_default=True, help="Odometries a run.")
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
    from sonar_explore.reports.real_sonar import put_into_docs, write_real_sonar
    from sonar_explore.studies.real_sonar.study import study_real_sonar

    with writable_folder(out):
        found = study_real_sonar(data, seeds)
        write_real_sonar(found, out)
        if docs is not None:
            put_into_docs(found, docs)
    click.echo(f"page: {out / 'index.html'}")


@click.command(short_help="SLAM on recorded scans: a log of ours or of others.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option(
    "--slam", type=click.Choice(SLAMS), default="chain", show_default=True, help="What corrects the pose."
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
