"""Depth cameras: a child process for each, since a camera's library may hang. Only a robot that has one loads this."""
