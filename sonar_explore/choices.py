"""Choices of the command line, spelled out here: what they stand for is too heavy to import for a help page."""

from typing import Any

import click

from sonar_explore.errors import unknown_name

SLAMS = ("chain", "grid-pf", "literal", "off", "scan-match", "smoothed", "truth")
"""Keys of `sonar_explore.slam.SLAMS`."""


class WholeNumber(click.IntRange):
    """click's own is called `integer range`, also of what is no number: "'abc' is not a valid integer range"."""

    name = "whole number"


class Named(click.ParamType):
    """One of a few names; the error reads like that of every other name: what is known, and which one is near."""

    name = "name"

    def __init__(self, what: str, names: tuple[str, ...]) -> None:
        self.what = what
        self.names = names

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """How the help page shows it."""
        return f"[{'|'.join(self.names)}]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The name; raises `SonarExploreError` for one that is not there."""
        if value not in self.names:
            raise unknown_name(self.what, value, self.names)
        return value
