"""Occupancy grids, and the format of files that map_server reads."""
