"""Robots on the local network, by name."""
