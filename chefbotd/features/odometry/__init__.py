"""Odometry: where the wheels say the robot is."""
