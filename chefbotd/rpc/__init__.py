"""JSON-RPC 2.0: requests, results, topics, roles and leases."""

from chefbotd.rpc.access import AccessError, Guard, load_guard
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.rpc.robot import Robot
from chefbotd.rpc.server import RpcServer

__all__ = ["AccessError", "ApiParameters", "Guard", "Robot", "RpcServer", "load_guard"]
