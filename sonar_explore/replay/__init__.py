"""Recorded measurements: note them down on a run, keep them in a file, read those of others, run SLAM on them again."""
