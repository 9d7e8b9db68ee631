"""The command that asks for a robot of one's own, question by question, and writes its configuration."""
