"""A voice for the robot, and an ear. It is no safety function."""
