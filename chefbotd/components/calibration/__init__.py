"""Calibration: the robot finds its real parameters."""
