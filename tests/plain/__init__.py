"""What runs in every cycle, written step by step: the oracles of the versions that are in one piece."""
