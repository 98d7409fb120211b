"""`smoothed`: poses, walls, points and wheels as one least-squares problem, solved again where it changed."""
