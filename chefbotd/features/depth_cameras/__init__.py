"""Depth cameras: their processes, and how they are. Only a robot with a `[[depth_camera]]` has this."""
