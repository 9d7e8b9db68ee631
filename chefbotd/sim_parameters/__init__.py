"""The simulator's parameters apart from what it builds, so that a daemon on a real robot loads no simulator."""
