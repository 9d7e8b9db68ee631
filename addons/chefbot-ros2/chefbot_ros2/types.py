"""The classes of rclpy's messages by their names."""

from importlib import import_module
from typing import Any


def class_of(type_name: str) -> Any:
    """The class of ``nav_msgs/msg/Odometry`` or the like; None where its package is not installed."""
    package, _, name = type_name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except ModuleNotFoundError:
        return None
