"""Depth cameras: their processes and their condition. Only a robot with a `[[depth_camera]]` loads this."""
