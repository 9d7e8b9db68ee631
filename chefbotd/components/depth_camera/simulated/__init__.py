"""Depth cameras on a simulated robot: what they would see of its world."""
