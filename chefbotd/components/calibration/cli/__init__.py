"""Calibration of a robot, step by step, and from recordings."""
