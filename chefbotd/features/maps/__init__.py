"""Maps: those that are stored, the one in use, and its places."""
