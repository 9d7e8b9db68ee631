"""Driving: the control loop, the gate with its fault detectors, and the reading of the wheels."""
