"""The command socket: JSON-RPC 2.0, one object per line."""

from chefbotd.api.access import AccessError, Guard, load_guard
from chefbotd.api.parameters import ApiParameters
from chefbotd.api.robot import Robot
from chefbotd.api.server import Server

__all__ = ["AccessError", "ApiParameters", "Guard", "Robot", "Server", "load_guard"]
