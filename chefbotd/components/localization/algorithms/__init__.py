"""Finds the robot's pose on a map, in pure steps."""
