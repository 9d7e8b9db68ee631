"""Recording: files with everything that happens, and the ring of the last minutes."""
