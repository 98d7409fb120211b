"""What the pages of all studies share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

if TYPE_CHECKING:
    from sonar_explore.studies.compare.results import Comparison
    from sonar_explore.studies.results import Study


def study_values(study: Study | Comparison) -> dict[str, Any]:
    """What the frame of every study's page shows: what was run, with which configuration."""
    return {
        "study": study,
        "config": msgspec.json.format(msgspec.json.encode(study.config)).decode(),
        "percent": lambda value: f"{100 * value:.0f} %",
    }
