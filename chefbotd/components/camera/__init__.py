"""The robot's camera: its pictures are passed on as they come, and decoded by whoever looks."""
