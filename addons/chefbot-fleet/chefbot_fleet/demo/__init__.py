"""``make fleet``: six simulated ChefBots in an office; a robot, the broker and the manager are killed meanwhile."""
