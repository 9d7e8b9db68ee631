"""The command flash."""
