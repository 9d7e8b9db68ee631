"""The truth about a simulated robot."""
