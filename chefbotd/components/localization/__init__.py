"""Localization on the map in use: the state of the pose, and the methods that set or search it."""
