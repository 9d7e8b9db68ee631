"""Driving to goals in the map in use."""
