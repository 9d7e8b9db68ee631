"""Recording: files of everything that happens, and the ring of the last minutes."""
