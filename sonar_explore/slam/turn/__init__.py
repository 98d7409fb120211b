"""What one turn of the robot says: what its eight discs agree on, walls and points (beyond the paper)."""
