"""A recording run again: the same parts of the daemon, fed from a file, without any hardware."""
