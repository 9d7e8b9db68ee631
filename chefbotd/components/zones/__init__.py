"""Zones: where navigation must not go, and where it goes slowly, drawn on a stored map."""
