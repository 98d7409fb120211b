"""One reader a file format; each ends in `validate` and returns a `World`."""
