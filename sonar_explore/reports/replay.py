"""The page of a replay: what was extracted from each scan, and the map of it all."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sonar_explore import __version__
from sonar_explore.episodes.files import write_atomically
from sonar_explore.replay.play import Replay, headline
from sonar_explore.reports.episode import _templates, _verbatim
from sonar_explore.reports.sonar_pictures import draw_replay, draw_scan, png, sheet

MOST_SCANS = 40
"""Scans of a log that are shown one by one."""


def write_replay_page(done: Sequence[Replay], path: Path) -> None:
    """One section a log."""
    write_sonar_page(path, "replay.html", logs=[_section(one) for one in done])


def write_sonar_page(path: Path, template: str, **values: Any) -> None:
    """A page of recorded sonar, in the look of the studies."""
    templates = _templates()
    styles = {"style": _verbatim(templates, "episode.css"), "study_style": _verbatim(templates, "study.css")}
    page = templates.get_template(template).render(version=__version__, **styles, **values)
    write_atomically(path, page.encode())


def picture_url(picture: bytes) -> str:
    """A PNG that travels within the page."""
    return "data:image/png;base64," + base64.b64encode(picture).decode()


def _section(done: Replay) -> dict[str, Any]:
    figure, (axes,) = sheet(1, 1, side=6.0)
    draw_replay(axes, done)
    shown = list(zip(done.updates, done.log.scans, done.mind.scans, strict=True))[:MOST_SCANS]
    scans, frames = sheet(len(shown), 5, side=2.6)
    for axes, (update, scan, entry) in zip(frames, shown, strict=True):
        draw_scan(axes, scan, entry.pose, update.features, title=f"scan {update.index}")
    return {
        "about": done.log.about,
        "headline": headline(done),
        "map": picture_url(png(figure)),
        "scans": picture_url(png(scans)),
        "left_out": len(done.updates) - len(shown),
    }
