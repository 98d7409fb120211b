"""Safe paths and candidate scan positions."""
