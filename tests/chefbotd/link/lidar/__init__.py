"""Lidars on their wires."""
