"""Drives the robot with roslibpy, and says what it saw as one JSON object: drive.py URL."""

import json
import sys
import threading
from collections.abc import Callable
from typing import Any

import roslibpy

PATIENCE_S = 100.0


def main(url: str) -> None:
    """Drive, stop, and arm again."""
    host, port = url.removeprefix("ws://").split(":")
    ros = roslibpy.Ros(host, int(port))
    ros.run(PATIENCE_S)
    odom = roslibpy.Topic(ros, "/odom", "nav_msgs/Odometry")
    velocity = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")
    description = roslibpy.Topic(ros, "/robot_description", "std_msgs/String")
    urdf = first(description, lambda message: True)["data"]
    over = threading.Event()

    def drive() -> None:
        while not over.wait(0.05):
            velocity.publish(roslibpy.Message({"linear": {"x": 0.2}, "angular": {"z": 0.1}}))

    driver = threading.Thread(target=drive)
    driver.start()
    moving = first(odom, lambda message: message["twist"]["twist"]["linear"]["x"] > 0.1)
    stopped = call(ros, "/estop")
    standing = first(odom, lambda message: message["twist"]["twist"]["linear"]["x"] == 0)
    over.set()
    driver.join()
    seen = {
        "topics": ros.get_topics(),
        "frame": moving["header"]["frame_id"],
        "stopped": stopped,
        "armed": call(ros, "/arm"),
        "x_m": standing["pose"]["pose"]["position"]["x"],
        "urdf": urdf[:200],
    }
    print(json.dumps(seen), flush=True)  # noqa: T201
    ros.terminate()


def first(topic: Any, holds: Callable[[Any], bool]) -> Any:
    """The first message of which this holds."""
    found: list[Any] = []
    has_found = threading.Event()

    def look(message: Any) -> None:
        if holds(message):
            found.append(message)
            has_found.set()

    topic.subscribe(look)
    assert has_found.wait(PATIENCE_S), topic.name
    topic.unsubscribe()
    return found[0]


def call(ros: Any, name: str) -> dict[str, Any]:
    """A service without parameters."""
    service = roslibpy.Service(ros, name, "std_srvs/Trigger")
    return dict(service.call(roslibpy.ServiceRequest(), timeout=PATIENCE_S))


main(sys.argv[1])
