"""Record, run, score and export episodes."""
