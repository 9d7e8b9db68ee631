"""chefbotd: an asyncio daemon for small wheeled service robots, without middleware."""

__version__ = "0.1.0"
