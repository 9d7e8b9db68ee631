"""Many robots on one map: traffic, orders, and a manager that speaks VDA 5050."""
