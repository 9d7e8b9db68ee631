"""The worker process: its input and its state."""
