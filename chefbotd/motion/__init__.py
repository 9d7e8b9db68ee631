"""Wheels and motion: pure steps, values in, values out, time an argument."""
