"""The page of a replay: what was extracted from each scan, and the map of it all."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sonar_explore.replay.play import Replay, headline
from sonar_explore.reports.page import write_page
from sonar_explore.reports.sonar_pictures import draw_replay, draw_scan, png, sheet

MOST_SCANS = 40
"""Scans of a log that are shown one by one,"""
SCANS_A_ROW = 3
"""beside the map."""


def write_replay_page(done: Sequence[Replay], path: Path) -> None:
    """One section a log."""
    write_page(path, "replay.html", logs=[_section(one) for one in done])


def picture_url(picture: bytes) -> str:
    """A PNG that travels within the page."""
    return "data:image/png;base64," + base64.b64encode(picture).decode()


def _section(done: Replay) -> dict[str, Any]:
    figure, (axes,) = sheet(1, 1, side=7.0)
    draw_replay(axes, done)
    shown = list(zip(done.updates, done.log.scans, done.mind.scans, strict=True))[:MOST_SCANS]
    scans, frames = sheet(len(shown), SCANS_A_ROW, side=2.6)
    for axes, (update, scan, entry) in zip(frames, shown, strict=True):
        draw_scan(axes, scan, entry.pose, update.features, title=f"scan {update.index}")
    return {
        "about": done.log.about,
        "headline": headline(done).removeprefix(f"{done.log.about}: "),
        "map": picture_url(png(figure)),
        "scans": picture_url(png(scans)),
        "left_out": len(done.updates) - len(shown),
    }
