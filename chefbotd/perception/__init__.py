"""Makes scans and points from sensor values: pure functions, time is an argument."""
