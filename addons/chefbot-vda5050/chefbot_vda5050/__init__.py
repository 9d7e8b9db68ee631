"""VDA 5050 for chefbotd: the robot's side of the interface between a fleet's manager and its robots."""
