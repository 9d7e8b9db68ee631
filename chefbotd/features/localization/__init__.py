"""Finding the way on the map in use: whether the robot knows where it is, and what a person tells it."""
