"""``chefbot-ros2``: the robot of a daemon as a ROS 2 node.

    chefbot-ros2 --connect 127.0.0.1:7333 --ros-args -r scan/lidar:=scan

What follows ``--ros-args`` is for ROS: names, namespace, parameters.
"""

import argparse
import asyncio
import signal
import sys
import threading
from functools import partial
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from chefbot_ros2.node import Bridge
from chefbot_ros2.session import Connect
from chefbotd.client.access import CA_HELP, CLEAR_TOKEN_HELP, daemon_access


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    own = rclpy.utilities.remove_ros_args(sys.argv)[1:]
    parser = argparse.ArgumentParser(prog="chefbot-ros2", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--connect", metavar="HOST:PORT", default="127.0.0.1:7333", help="the daemon's socket"
    )
    parser.add_argument("--token-file", type=Path, help="a file with a token of the role drive")
    parser.add_argument("--ca", type=Path, help=CA_HELP)
    parser.add_argument("--clear-token", action="store_true", help=CLEAR_TOKEN_HELP)
    parser.add_argument(
        "--unconfigured", action="store_true", help="leave configuring and activating to a lifecycle manager"
    )
    options = parser.parse_args(own)
    host, _, port = options.connect.rpartition(":")
    try:
        access = daemon_access(
            host, int(port), options.token_file, options.ca, clear_token=options.clear_token
        )
    except ValueError as error:
        parser.error(str(error))
    connect = partial(access.connect, "ros2")
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    try:
        code = asyncio.run(_run(connect, unconfigured=options.unconfigured))
    finally:
        rclpy.try_shutdown()
    sys.exit(code)


async def _run(connect: Connect, *, unconfigured: bool) -> int:
    """The exit code: 1 after a mistake of ours."""
    loop, over, failures = asyncio.get_running_loop(), asyncio.Event(), [0]

    def fail() -> None:
        failures.append(1)
        over.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, over.set)
    node = Bridge(loop, connect, fail)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=_spin, args=(executor,), name="rclpy")
    thread.start()
    try:
        if not unconfigured:
            await asyncio.to_thread(node.trigger_configure)
            await asyncio.to_thread(node.trigger_activate)
        await over.wait()
        await asyncio.to_thread(node.trigger_shutdown)
    finally:
        executor.shutdown()
        await asyncio.to_thread(thread.join)
        node.destroy_node()
    return failures[-1]


def _spin(executor: SingleThreadedExecutor) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


if __name__ == "__main__":
    main()
