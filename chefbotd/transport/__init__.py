"""How requests and events travel: each transport is a user of ``chefbotd.rpc``."""
