"""The transports of requests and events. Each one uses ``chefbotd.rpc``."""
