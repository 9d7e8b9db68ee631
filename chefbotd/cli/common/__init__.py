"""Shared parts of the commands: arguments, exit codes, output, the connection."""
