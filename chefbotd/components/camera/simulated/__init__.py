"""The camera of a simulated robot: what it would see of its room."""
