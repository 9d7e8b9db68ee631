"""chefbotd: a middleware-free asyncio daemon for small wheeled service robots."""

__version__ = "0.1.0"
