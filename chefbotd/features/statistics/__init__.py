"""Statistics: what was counted, once a second."""
