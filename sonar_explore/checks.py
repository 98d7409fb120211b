"""Numbers of a configuration that cannot be, said in one line before anything runs."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import fields, is_dataclass

from sonar_explore.errors import SonarExploreError


def check_numbers(
    config: object, path: str, *, or_zero: Collection[str] = (), or_negative: Collection[str] = ()
) -> None:
    """Refuse numbers that are not above zero, or not at all, in a tree of dataclasses.

    Args:
        config: the tree; what is no number in it is passed over.
        path: its own name, for the message.
        or_zero: dotted names below it that may be zero as well.
        or_negative: those that may be anything finite.

    Raises:
        SonarExploreError: names the first that is refused.
    """
    for item in fields(config):  # type: ignore[arg-type]
        value, name = getattr(config, item.name), f"{path}.{item.name}"
        below = [_without(item.name, names) for names in (or_zero, or_negative)]
        if is_dataclass(value):
            check_numbers(value, name, or_zero=below[0], or_negative=below[1])
        elif isinstance(value, bool) or not isinstance(value, int | float):
            continue
        elif item.name in or_negative:
            if not math.isfinite(value):
                raise SonarExploreError(f"{name} must be a finite number, not {value!r}")
        elif item.name in or_zero:
            if not value >= 0:
                raise SonarExploreError(f"{name} must be zero or more, not {value!r}")
        elif not value > 0:
            raise SonarExploreError(f"{name} must be greater than zero, not {value!r}")


def _without(first: str, names: Collection[str]) -> list[str]:
    """What comes after `first.` in those names that begin with it."""
    return [name.removeprefix(f"{first}.") for name in names if name.startswith(f"{first}.")]
