"""Statistics: the daemon's figures, once a second."""
