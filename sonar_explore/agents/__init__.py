"""The will of the robot: exploration policies."""
