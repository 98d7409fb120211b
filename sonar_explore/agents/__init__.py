"""The will of the robot: exploration policies, ours and anybody's."""

from __future__ import annotations

import importlib
import sys
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from sonar_explore.agents.base import Decision, ExplorationPolicy, Score
from sonar_explore.errors import SonarExploreError, unknown_name

__all__ = ["Decision", "ExplorationPolicy", "Score", "known_agents", "make_agent"]

GROUP = "sonar_explore.agents"


def known_agents() -> dict[str, str]:
    """Name and one-line description of every policy that is installed."""
    return {name: _first_line(point) for name, point in sorted(_points().items())}


def make_agent(name: str) -> ExplorationPolicy:
    """The policy of this name, or of this path `module:Name`."""
    points = _points()
    if name in points:
        made = _made(name, points[name])
    elif ":" in name:
        made = _made(name, EntryPoint(name, name, GROUP))
    else:
        raise SonarExploreError(f"{unknown_name('agent', name, points)}, or module:Name")
    if not callable(getattr(made, "choose", None)):
        raise SonarExploreError(
            f"agent {name!r} has no method choose(situation); see sonar_explore.agents.base"
        )
    policy: ExplorationPolicy = made
    return policy


def _points() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


def _made(name: str, point: EntryPoint) -> Any:
    try:
        return _load(name, point)()
    except TypeError as error:  # no class at all, or one that wants arguments
        raise SonarExploreError(
            f"agent {name!r} cannot be made: {error}; a class without arguments can"
        ) from error


def _load(name: str, point: EntryPoint) -> Any:
    try:
        if not EntryPoint.pattern.match(point.value):
            raise ImportError("no names of a module and a class")
        importlib.invalidate_caches()
        return point.load()
    except (ImportError, AttributeError, ValueError, SyntaxError) as error:
        module = point.value.partition(":")[0].partition(".")[0]
        if module in sys.stdlib_module_names:
            raise SonarExploreError(
                f"agent {name!r} cannot be loaded: {module!r} is the name of a module of Python's own, "
                "which hides any other; give your module another name"
            ) from error
        where = "module:Name, the module in the working folder, on PYTHONPATH or installed"
        raise SonarExploreError(f"agent {name!r} cannot be loaded: {error}; give {where}") from error


def _first_line(point: EntryPoint) -> str:
    doc = _load(point.name, point).__doc__ or ""
    return str(doc.strip().split("\n")[0])
