"""The command that asks for a robot of one's own."""
