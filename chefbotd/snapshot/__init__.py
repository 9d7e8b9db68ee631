"""What the parts of the daemon remember, as plain values: taken from one daemon, put into another one like it."""
