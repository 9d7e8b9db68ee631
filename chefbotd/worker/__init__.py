"""The child process that maps, localizes and plans, and the link to it."""
