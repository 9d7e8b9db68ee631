"""ROS 2 for chefbotd."""
