"""What the worker can do. Each skill is a class in a module of its own, which only the worker imports."""
