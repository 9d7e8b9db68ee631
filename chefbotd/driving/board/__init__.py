"""The board: its link, its restart, and its lines."""
