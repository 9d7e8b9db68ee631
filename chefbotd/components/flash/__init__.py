"""The command flash: puts the project's own firmware on a board."""
