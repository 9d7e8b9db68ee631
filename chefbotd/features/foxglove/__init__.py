"""Foxglove: the content of a recording, live."""
