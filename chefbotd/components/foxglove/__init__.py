"""Serves Foxglove the channels of a recording, live."""
