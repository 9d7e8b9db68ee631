"""Maps in the terminal: the commands ``map`` and ``places``, and drawing."""
