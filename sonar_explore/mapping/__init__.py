"""Features onto a grid; frontiers."""
