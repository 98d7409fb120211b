"""`explore-plans`: whether exploration finishes buildings that nobody tuned for."""
