"""Tools for those who write programs for a robot: a Python prompt, and sweeps over seeds and worlds."""
