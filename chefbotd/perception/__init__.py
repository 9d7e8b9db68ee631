"""What the robot sees of its surroundings, from bytes' values to scans: pure, time is an argument."""
