"""Converts raw sensor readings to SI values: pure functions."""
