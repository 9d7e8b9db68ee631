"""Maps in the terminal: drawing one, the commands ``map`` and ``places``."""
