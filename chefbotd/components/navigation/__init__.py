"""Driving to goals on the map in use."""
