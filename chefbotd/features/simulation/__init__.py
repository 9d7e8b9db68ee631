"""The true pose of a simulated robot."""
