"""Lidars: their links and their scans. Only a robot with a `[[lidar]]` loads this."""
