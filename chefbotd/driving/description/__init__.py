"""The description of the robot."""
