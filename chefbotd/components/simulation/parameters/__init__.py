"""The simulator's parameters without the simulator, so that a daemon on a real robot does not load it."""
