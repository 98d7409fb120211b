"""The page of one episode: a single html file that opens anywhere, with no network."""

from __future__ import annotations

import base64
import gzip
import math
from pathlib import Path
from typing import Any

import msgspec
from markupsafe import Markup

from sonar_explore.episodes.files import write_atomically
from sonar_explore.episodes.record import EpisodeRecord, Summary
from sonar_explore.errors import SonarExploreError
from sonar_explore.reports import scene
from sonar_explore.reports.charts import episode_charts
from sonar_explore.reports.frame import frame_of, scale_bar
from sonar_explore.reports.page import templates, verbatim, write_page
from sonar_explore.reports.words import glossary
from sonar_explore.wording import counted


def write_episode_report(record: EpisodeRecord, path: Path) -> None:
    """Write the report of `record` to `path`, whole or not at all."""
    write_atomically(path, episode_page(record).encode())


def write_packed_report(record: EpisodeRecord, path: Path) -> None:
    """The episode's page, packed into a page that unpacks itself: a quarter of its size."""
    packed = base64.b64encode(gzip.compress(episode_page(record).encode(), 9, mtime=0)).decode()
    s = record.summary
    title = f"{s.world}, {s.slam}, seed {s.seed}"
    write_page(path, "packed.html", title=title, packed=packed)


def episode_page(record: EpisodeRecord) -> str:
    """The page; the same record gives the same text."""
    if not record.steps:
        raise SonarExploreError("an episode without a scan has nothing to report")
    frame = frame_of(record)
    template = templates().get_template("episode.html")
    return template.render(
        record=record,
        summary=record.summary,
        tiles=tiles(record.summary),
        frame=frame,
        bar_m=scale_bar(frame),
        changes=scene.map_changes(record, frame),
        chains=scene.chain_rows(record),
        past=scene.past_walls(record),
        cut=scene.cut_associations(record),
        drives=[
            (step, scene.drive(step, before), scene.true_drive(step, before))
            for before, step in zip([None, *record.steps], record.steps, strict=False)
        ],
        charts=episode_charts(record),
        words=glossary(record),
        degrees=math.degrees,
        style=verbatim("episode.css"),
        script=verbatim("episode.js"),
        data=_script_json({"scans": scene.scan_data(record, frame), "robot": frame.length(0.18)}),
        config=msgspec.json.format(msgspec.json.encode(record.config)).decode(),
    )


def tiles(summary: Summary) -> list[tuple[str, str, str]]:
    """(label, value, note) of the key figures."""
    position, heading = summary.position_error_m, summary.heading_error_deg
    wall_error = "no occupied cell" if summary.wall_error_m is None else f"{summary.wall_error_m:.3f} m off"
    loop = [] if summary.loop_closed is None else [("Loop", "closed" if summary.loop_closed else "open", "")]
    return [
        ("Explored", f"{100 * summary.explored_fraction:.1f} %", "in sight of its true scans"),
        (
            "Final position error",
            f"{position.final:.3f} m",
            f"mean {position.mean:.3f}, max\u00a0{position.max:.3f}",
        ),
        (
            "Final heading error",
            f"{heading.final:.1f}°",
            f"mean {heading.mean:.1f}, max\u00a0{heading.max:.1f}",
        ),
        ("Walls on the map", f"{100 * summary.wall_recall:.0f} %", wall_error),
        ("False-free", f"{100 * summary.false_free_fraction:.2f} %", "free cells that are not"),
        (
            "Driven",
            f"{summary.path_length_m:.1f} m",
            f"{counted(summary.scans, 'scan')}, {_duration(summary.sim_time_s)}",
        ),
        ("Contacts", str(summary.contacts), "with walls"),
        ("Chains", str(summary.chains), f"{summary.dangling_chains} dangling, {summary.merges} merged"),
        *loop,
    ]


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}\u00a0min\u00a0{rest:02d}\u00a0s"


def _script_json(data: Any) -> Markup:
    """JSON that no text in it can break out of a script element."""
    text = msgspec.json.encode(data).decode()
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)
