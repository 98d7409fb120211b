"""Pages that open with no network."""
