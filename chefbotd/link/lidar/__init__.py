"""Lidars: a serial link for each, from bytes to whole turns. Only a robot with a lidar loads this."""
