"""The page of real sonar: tables, pictures, and the same as Markdown for the docs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sonar_explore.episodes.files import write_atomically
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Segment
from sonar_explore.replay.play import Replay
from sonar_explore.reports.page import write_page
from sonar_explore.reports.replay import picture_url
from sonar_explore.reports.sonar_pictures import ECHO, INK, SOFT, TRUE, draw_replay, draw_scan, png, sheet
from sonar_explore.studies.real_sonar.fit import BeamFit
from sonar_explore.studies.real_sonar.study import NOISES, SLAMS, PoseErrors, RealSonar, ScanSet
from sonar_explore.studies.tables import Table

MARK = "<!-- real-sonar -->", "<!-- end of real-sonar -->"


def write_real_sonar(found: RealSonar, folder: Path) -> None:
    """`index.html`, `tables.md`, and the pictures as files."""
    shown = pictures(found)
    for name, picture in shown.items():
        write_atomically(folder / f"{name}.png", picture)
    write_atomically(folder / "tables.md", (markdown(found) + "\n").encode())
    write_page(
        folder / "index.html",
        "real_sonar.html",
        found=found,
        extraction=extraction_table(found),
        poses=pose_table(found),
        pooled=pooled_table(found),
        alike=likeness_table(found),
        pictures={name: picture_url(picture) for name, picture in shown.items()},
        names={picture_name(s): s.name for s in found.sets},
    )


def markdown(found: RealSonar) -> str:
    """The tables, for the docs."""
    beam = found.beam
    parts = [
        "### Extraction",
        extraction_table(found).markdown(),
        "### Pose errors, all folders together",
        pooled_table(found).markdown(),
        "### Pose errors, folder by folder",
        pose_table(found).markdown(),
        "### The sensor and its twin",
        f"Fit: amplitude down to 1/e at {beam.s_deg:.1f} degrees, a plane 1 m away just heard at {beam.heard_deg:.1f}, "
        f"from {len(beam.range_m)} plateaus.",
        likeness_table(found).markdown(),
    ]
    return "\n\n".join(parts)


def extraction_table(found: RealSonar) -> Table:
    """One row a set, and the quality of its scans' poses; then all of one quality."""
    qualities = [(s, v, q) for s in found.sets for v, q in zip(s.verdicts, s.quality, strict=True)]
    groups = [(s.name, [v for t, v, _ in qualities if t is s], ", ".join(s.quality)) for s in found.sets]
    groups += [(f"all {q}", [v for _, v, p in qualities if p == q], q) for q in ("good", "fair", "poor")]
    rows = []
    for name, verdicts, quality in groups:
        true = sum(sum(v.true) for v in verdicts)
        walls = sum(len(v.walls) for v in verdicts)
        seen = sum(len(v.found) for v in verdicts)
        hit = sum(sum(v.found) for v in verdicts)
        rows.append((name, quality, f"{len(verdicts)}", _share(true, walls), _share(hit, seen)))
    return Table(("scans of", "fit of the pose", "scans", "precision", "recall"), tuple(rows))


def pose_table(found: RealSonar) -> Table:
    """One row a set and SLAM: the median over the seeds, and the 95th percentile."""
    rows = []
    for scans in found.sets:
        for slam in SLAMS:
            cells = [_errors_text([_one(found, scans.name, noise, slam)]) for noise in NOISES]
            rows.append((scans.name, slam, *(text for pair in cells for text in pair)))
    return Table(("scans of", "SLAM", *_error_columns()), tuple(rows))


def pooled_table(found: RealSonar) -> Table:
    """One row a SLAM, over all sets and seeds."""
    rows = []
    for slam in SLAMS:
        cells = [
            _errors_text([e for e in found.errors if (e.noise, e.slam) == (noise, slam)]) for noise in NOISES
        ]
        rows.append((slam, *(text for pair in cells for text in pair)))
    return Table(("SLAM", *_error_columns()), tuple(rows))


def likeness_table(found: RealSonar) -> Table:
    """Recorded scans beside simulated ones."""
    rows = tuple(
        (
            one.name,
            f"{100 * one.silent:.0f} %",
            "-" if one.near is None else f"{100 * one.near:.0f} %",
            f"{one.walls:.1f}",
            f"{one.width_deg:.0f}",
            f"{one.precision:.2f}",
            f"{one.recall:.2f}",
        )
        for one in found.likenesses
    )
    columns = ("scans", "silent", "within 10 cm of the recorded", "walls a scan", "median width [deg]")
    return Table((*columns, "precision", "recall"), rows)


def pictures(found: RealSonar) -> dict[str, bytes]:
    """PNG files by name."""
    drawn = {
        picture_name(s): _set_picture(s, r, found.walls) for s, r in zip(found.sets, found.shown, strict=True)
    }
    drawn["beam"] = _beam_picture(found.beam)
    for kind in dict.fromkeys(done.log.about.split(",")[0] for done in found.others):
        drawn[kind] = _others_picture([d for d in found.others if d.log.about.startswith(kind)])
    return drawn


def picture_name(scans: ScanSet) -> str:
    """Of its file."""
    return scans.name.replace(", ", "-").strip("_")


def put_into_docs(found: RealSonar, page: Path) -> None:
    """Make the tables of the page anew, and the pictures in the folder of its name beside it."""
    begin, end = MARK
    try:
        before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    except OSError as error:
        raise SonarExploreError(f"cannot read {page}: {error.strerror}") from error
    _, found_end, after = rest.partition(end)
    if not found_end:
        raise SonarExploreError(f"{page} has no section {begin} to {end}")
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    for name, picture in pictures(found).items():
        write_atomically(folder / f"{name}.png", picture)
    write_atomically(page, f"{before}{begin}\n{markdown(found)}\n{end}{after}".encode())


def _error_columns() -> list[str]:
    return [f"{noise}: {what}" for noise in NOISES for what in ("position [cm]", "heading [deg]")]


def _errors_text(errors: Sequence[PoseErrors]) -> tuple[str, str]:
    position = 100 * np.concatenate([e.position_m for e in errors])
    heading = np.concatenate([e.heading_deg for e in errors])
    return tuple(f"{np.median(x):.1f} ({np.quantile(x, 0.95):.1f})" for x in (position, heading))  # type: ignore[return-value]


def _one(found: RealSonar, name: str, noise: str, slam: str) -> PoseErrors:
    return next(e for e in found.errors if (e.scans, e.noise, e.slam) == (name, noise, slam))


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.2f} ({part} of {whole})" if whole else "-"


def _set_picture(scans: ScanSet, done: Replay, walls: Sequence[Segment]) -> bytes:
    figure, frames = sheet(len(scans.verdicts) + 1, 6, side=2.5)
    for k, (axes, v) in enumerate(zip(frames, scans.verdicts, strict=False)):
        title = f"waypoint {k + 1}, {scans.quality[k]}"
        draw_scan(axes, v.scan, v.pose, v.extracted, walls=walls, on_wall=v.true, title=title)
    draw_replay(frames[-1], done, walls, "run: odometry paper, chain")
    return png(figure)


def _others_picture(done: Sequence[Replay]) -> bytes:
    scans = [(d, u, s, e) for d in done for u, s, e in zip(d.updates, d.log.scans, d.mind.scans, strict=True)]
    figure, frames = sheet(len(scans), 4, side=3.0)
    for axes, (replayed, update, scan, entry) in zip(frames, scans, strict=True):
        name = replayed.log.about.split(", ")[1]
        title = name if len(replayed.updates) == 1 else f"{name}, stretch {update.index + 1}"
        draw_scan(axes, scan, entry.pose, update.features, title=title)
    return png(figure)


def _beam_picture(beam: BeamFit) -> bytes:
    figure = Figure(figsize=(5.4, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.plot(beam.range_m, beam.half_deg, "o", color=ECHO, markersize=4, label="plateaus on true walls")
    ranges = np.linspace(0.2, 2.2, 100)
    axes.plot(ranges, beam.at(ranges), color=TRUE, label="fitted beam")
    axes.set_xlabel("range [m]", color=INK, fontsize=8.5)
    axes.set_ylabel("half the width [deg]", color=INK, fontsize=8.5)
    axes.set_ylim(bottom=0)
    axes.tick_params(labelsize=7.5, colors=SOFT)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    return png(figure)
