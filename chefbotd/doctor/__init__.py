"""What the doctor concludes: measurements in, findings out. No I/O, no clock; ``cli/doctor`` gathers and asks."""
