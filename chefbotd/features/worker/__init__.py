"""The worker process: what it is fed with, and how it stands."""
