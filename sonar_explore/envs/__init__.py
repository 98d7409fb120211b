"""The world and its physics: the only place that knows the truth."""
