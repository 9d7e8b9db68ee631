"""The simulated robot as the daemon's process runs it: its board, its cameras, and the true values for tests."""
