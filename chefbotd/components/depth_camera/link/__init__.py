"""Depth cameras: a child process for each, because a camera's library may hang. Only a robot with one loads this."""
