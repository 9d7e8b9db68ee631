"""Foxglove: everything that a recording has, live."""
