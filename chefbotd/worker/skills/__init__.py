"""The worker's skills. Each is a class in its own module, which only the worker imports."""
