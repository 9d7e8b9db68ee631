"""Draws the edits of a map onto its cells."""
