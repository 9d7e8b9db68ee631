"""The commands that make, show and replay recordings."""
