"""Names for the command line, spelled out here: what they stand for is too heavy to import for a help page."""

SLAMS = ("chain", "grid-pf", "literal", "off", "scan-match", "smoothed", "truth")
"""Keys of `sonar_explore.slam.SLAMS`."""
