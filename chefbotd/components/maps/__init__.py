"""Maps: the stored ones, the one in use, and its places."""
