"""What every page is made with: the templates, the styles, and one file that opens with no network."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from sonar_explore import __version__
from sonar_explore.episodes.files import write_atomically


def write_page(path: Path, template: str, **values: Any) -> None:
    """A page of a template, in the look of the studies."""
    styles = {"style": verbatim("episode.css"), "study_style": verbatim("study.css")}
    page = templates().get_template(template).render(version=__version__, **styles, **values)
    write_atomically(path, page.encode())


@cache
def templates() -> Environment:
    """Those of this package; a name that a template lacks is an error."""
    return Environment(
        loader=PackageLoader("sonar_explore.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def verbatim(name: str) -> Markup:
    """One of our own files, as it is."""
    loader = templates().loader
    assert loader is not None
    return Markup(loader.get_source(templates(), name)[0])
