"""The board's own program: its portable core in a host build, and its images in emulators."""
