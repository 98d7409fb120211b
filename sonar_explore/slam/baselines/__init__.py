"""What others would pick, to compare with: a particle filter on grids, scan matching."""
