"""Driving: the control loop, the keeper of the gate and the detectors, and what reads the wheels."""
