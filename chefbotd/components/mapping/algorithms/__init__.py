"""Makes maps from scans and odometry, saves and reads them: pure functions."""
