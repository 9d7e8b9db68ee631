"""Odometry: the robot's pose by its wheels."""
