"""Where the robot is on a map: pure steps."""
