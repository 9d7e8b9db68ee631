"""Another ROS process, for the tests: publishes, calls services, and tells what it receives.

It reads a JSON object a line, ``{"do": "subscribe", ...}``, and writes one for each message and each answer.
"""

import json
import math
import os
import sys
import threading
import time
from importlib import import_module
from typing import Any

import numpy as np
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

QOS = {
    "reliable": QoSProfile(depth=100),
    "sensor": QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT),
    "latched": QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
}


def type_of(name: str) -> Any:
    """``nav_msgs/msg/Odometry``."""
    package, group, short = name.split("/")
    return getattr(import_module(f"{package}.{group}"), short)


def plain(value: Any) -> Any:
    """A message as JSON has it; what is not finite as text."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value.tolist()]
    if isinstance(value, bytes):
        return list(value)
    if isinstance(value, (list, tuple)) or type(value).__name__ == "array":
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def fill(message: Any, fields: dict[str, Any]) -> Any:
    """Set these fields of a message."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def tell(**words: Any) -> None:
    """A line for the test; with one write, for two threads write."""
    os.write(1, json.dumps(words).encode() + b"\n")


class Probe:
    """Carries out one command after the other."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("probe")
        self.publishers: dict[str, Any] = {}
        self.clients: dict[str, Any] = {}

    def subscribe(self, topic: str, type: str, qos: str) -> None:
        """Tell each message of a topic."""

        def take(message: Any) -> None:
            now_ns = self.node.get_clock().now().nanoseconds
            tell(topic=topic, received_ns=now_ns, message=plain(message))

        self.node.create_subscription(type_of(type), topic, take, QOS[qos])

    def publish(self, topic: str, type: str, fields: dict[str, Any]) -> None:
        """Publish a message once."""
        publisher = self.publishers.get(topic)
        if publisher is None:
            publisher = self.publishers[topic] = self.node.create_publisher(type_of(type), topic, 1)
        publisher.publish(fill(type_of(type)(), fields))

    def publish_timed(self, topic: str, type: str, fields: dict[str, Any]) -> None:
        """Publish a message once, and tell when."""
        at_ns = time.time_ns()
        self.publish(topic, type, fields)
        tell(of="published", at_ns=at_ns)

    def listeners(self, topic: str, type: str) -> None:
        """Tell how many listen to what this process publishes."""
        if topic not in self.publishers:
            self.publishers[topic] = self.node.create_publisher(type_of(type), topic, 1)
        tell(listeners=self.publishers[topic].get_subscription_count(), of=topic)

    def call(self, service: str, type: str, fields: dict[str, Any]) -> None:
        """Call a service, and tell its answer."""
        kind = type_of(type)
        client = self.clients.get(service)
        if client is None:
            client = self.clients[service] = self.node.create_client(kind, service)
        client.wait_for_service()
        future = client.call_async(fill(kind.Request(), fields))
        future.add_done_callback(lambda done: tell(service=service, answer=plain(done.result())))


def main() -> None:
    """Until the input ends."""
    rclpy.init()
    probe = Probe()
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(probe.node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    tell(ready=True)
    for line in sys.stdin:
        command = json.loads(line)
        getattr(probe, command.pop("do"))(**command)
    executor.shutdown()


main()
