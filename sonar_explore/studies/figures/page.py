"""docs/figures: the figures as SVG, and a page that shows them; the same code gives the same files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from sonar_explore.studies.figures.drawing import STYLE
from sonar_explore.studies.figures.link_graph import figure_5, figure_6, figure_7, figure_8, figure_9
from sonar_explore.studies.figures.localization import figure_11, figure_12
from sonar_explore.studies.figures.moments import Moment, telling_moment
from sonar_explore.studies.figures.probability import figure_10

FOLDER = Path("docs/figures")


FIGURES: dict[int, Callable[[Moment], Figure]] = {
    5: figure_5,
    6: figure_6,
    7: figure_7,
    8: figure_8,
    9: figure_9,
    10: figure_10,
    11: figure_11,
    12: figure_12,
}


def write_figures(folder: Path = FOLDER, moment: Moment | None = None) -> list[Path]:
    """All of them as SVG, and a page that shows them."""
    moment = moment or telling_moment()
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        for number, draw in FIGURES.items():
            path = folder / f"figure-{number:02d}.svg"
            draw(moment).savefig(path, metadata={"Date": None})
            paths.append(path)
    (folder / "README.md").write_text(_page(moment), encoding="utf-8")
    return paths


def _page(moment: Moment) -> str:
    head = (
        "# Figures 5 to 12, redrawn\n\nMade by `python -m sonar_explore.studies.figures` from scan "
        f"{moment.update.index} of `{moment.world}`, `--slam literal`, seed {moment.seed}: of all scans the "
        "one at which both fits had most to do (`studies/figures/moments.py`).\n"
    )
    parts = [
        f"## Figure {n}\n\n{(draw.__doc__ or '').strip()}\n\n![Figure {n}](figure-{n:02d}.svg)\n"
        for n, draw in FIGURES.items()
    ]
    return "\n".join([head, *parts])
