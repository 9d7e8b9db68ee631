"""Who may move the robot, and whether it may move at all: pure decisions."""
