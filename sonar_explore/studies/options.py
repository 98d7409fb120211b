"""Options by their dotted name, as records and documents call them: `slam.features.beam_check`."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from sonar_explore.errors import unknown_name

T = TypeVar("T")


def option(config: Any, name: str) -> Any:
    """The value of the option `name` in a tree of frozen dataclasses."""
    for part in name.split("."):
        _check(config, part)
        config = getattr(config, part)
    return config


def with_option(config: T, name: str, value: Any) -> T:
    """A copy of the tree in which one option has another value."""
    first, _, rest = name.partition(".")
    _check(config, first)
    inner = with_option(getattr(config, first), rest, value) if rest else value
    return replace(config, **{first: inner})  # type: ignore[type-var]


def options(config: Any, prefix: str = "") -> dict[str, Any]:
    """Every leaf of the tree by its dotted name."""
    leaves: dict[str, Any] = {}
    for item in fields(config):
        value, name = getattr(config, item.name), prefix + item.name
        leaves |= options(value, f"{name}.") if is_dataclass(value) else {name: value}
    return leaves


def _check(config: Any, part: str) -> None:
    known = [item.name for item in fields(config)] if is_dataclass(config) else []
    if part not in known:
        raise unknown_name("option", part, known)
