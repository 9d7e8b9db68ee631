"""The command socket: JSON-RPC 2.0, one object per line."""

from chefbotd.api.parameters import ApiParameters
from chefbotd.api.robot import Robot
from chefbotd.api.server import Server

__all__ = ["ApiParameters", "Robot", "Server"]
