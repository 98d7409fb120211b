"""Figures 5 to 12 of the paper, redrawn from an episode of ours."""
