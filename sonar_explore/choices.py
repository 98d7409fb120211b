"""Choices of the command line, spelled out here: what they stand for is too heavy to import for a help page."""

import click

SLAMS = ("chain", "grid-pf", "literal", "off", "scan-match", "smoothed", "truth")
"""Keys of `sonar_explore.slam.SLAMS`."""


class WholeNumber(click.IntRange):
    """click's own is called `integer range`, also of what is no number: "'abc' is not a valid integer range"."""

    name = "whole number"
