"""Finds a robot's real parameters: motions to drive, and fits to what was measured meanwhile. Pure functions."""
