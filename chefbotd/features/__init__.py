"""One folder per capability: its service, its methods with their models, its topics and its metrics."""
