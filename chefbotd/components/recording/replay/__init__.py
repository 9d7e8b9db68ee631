"""Runs a recording again through the same parts of the daemon, without any hardware."""
