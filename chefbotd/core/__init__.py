"""The shared types of all other packages."""
