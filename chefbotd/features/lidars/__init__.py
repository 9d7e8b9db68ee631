"""Lidars: their links, and what they see. Only a robot with a `[[lidar]]` has this."""
