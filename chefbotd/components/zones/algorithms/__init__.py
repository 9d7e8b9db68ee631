"""Turns masks of cells into outlines of zones."""
