"""The state of the daemon's parts as plain values: captured in one daemon, restored in another."""
