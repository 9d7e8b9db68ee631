"""Notifications: somebody who is away is told by ntfy or a webhook what has become of the robot."""
