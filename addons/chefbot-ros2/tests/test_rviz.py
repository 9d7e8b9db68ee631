"""RViz's buttons, pressed by another ROS process, drive the robot of ``examples/ros2``."""

import asyncio
import math
from pathlib import Path

import pytest
from ros import Message, Probe, bridge, probe

from chefbotd.client import Client
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.geometry import Pose2D
from examples.order import PLACES
from examples.ros2.__main__ import robot_in_the_flat

POSE_BUTTON, GOAL_BUTTON = "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped"
CLICKED_M, CLICKED_RAD = 0.15, 0.1
"""How far from the truth somebody clicks."""

ARRIVED_M = 0.25


def stamped(pose: Pose2D) -> Message:
    """A pose in the frame in which RViz shows the map."""
    turn = {"z": math.sin(pose.heading_rad / 2), "w": math.cos(pose.heading_rad / 2)}
    return {"position": {"x": pose.x_m, "y": pose.y_m}, "orientation": turn}


def place(message: Message, parent: str) -> Pose2D | None:
    """Where a transform puts its child."""
    for one in message["transforms"]:
        if one["header"]["frame_id"] == parent:
            moved, turned = one["transform"]["translation"], one["transform"]["rotation"]
            return Pose2D(moved["x"], moved["y"], 2 * math.atan2(turned["z"], turned["w"]))
    return None


async def until_localized(other: Probe) -> None:
    """Until the diagnostics say so."""

    def is_localized(message: Message) -> bool:
        return any("localization" in one["name"] and one["level"] == [0] for one in message["status"])

    await other.until("/diagnostics", is_localized)


@pytest.mark.timeout(400)
def test_rvizs_buttons_localize_the_robot_and_send_it_to_a_goal(tmp_path: Path) -> None:
    """Who comes late has the map; a pose in the wrong frame moves nothing; the goal is reached, as tf has it too."""

    async def scenario() -> None:
        async with robot_in_the_flat(tmp_path) as port, bridge(port), probe() as other:
            await other.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
            await other.until("/diagnostics", lambda message: message["status"][0]["level"] == [0])
            await other.subscribe("/map", "nav_msgs/msg/OccupancyGrid", "latched")
            about = (await other.until("/map"))["info"]
            grid = FLAT.grid()
            assert (about["height"], about["width"]) == grid.percent.shape
            assert other.received["/map"][0]["data"] == grid.percent.ravel().tolist()
            start = FLAT.start
            clicked = Pose2D(start.x_m + CLICKED_M, start.y_m, start.heading_rad + CLICKED_RAD)
            await other.until_listened("/initialpose", POSE_BUTTON)
            await other.publish(
                "/initialpose",
                POSE_BUTTON,
                {"header": {"frame_id": "map"}, "pose": {"pose": stamped(clicked)}},
            )
            await until_localized(other)
            goal = PLACES["table 1"]
            await other.until_listened("/goal_pose", GOAL_BUTTON)
            await other.publish(
                "/goal_pose", GOAL_BUTTON, {"header": {"frame_id": "odom"}, "pose": stamped(Pose2D())}
            )
            await other.until(
                "/diagnostics", lambda message: "expected the frame map" in message["status"][0]["message"]
            )
            await other.subscribe("/plan", "nav_msgs/msg/Path", "latched")
            await other.publish(
                "/goal_pose", GOAL_BUTTON, {"header": {"frame_id": "map"}, "pose": stamped(goal)}
            )
            plan = await other.until("/plan", lambda message: len(message["poses"]) > 1)
            end = plan["poses"][-1]["pose"]["position"]
            assert math.hypot(end["x"] - goal.x_m, end["y"] - goal.y_m) < ARRIVED_M
            async with Client.connect(port=port) as robot, robot.subscribe("navigation") as events:
                async for event in events:
                    assert event.data.state in ("idle", "planning", "driving", "recovering", "reached"), (
                        event.data
                    )
                    if event.data.state == "reached":
                        break
                truth = (await robot.get_state()).sim
            assert math.hypot(truth.x_m - goal.x_m, truth.y_m - goal.y_m) < ARRIVED_M
            await other.subscribe("/tf", "tf2_msgs/msg/TFMessage")
            frames = await other.until("/tf", lambda message: len(message["transforms"]) == 2)
            map_from_odom, odom_from_base = place(frames, "map"), place(frames, "odom")
            assert map_from_odom is not None
            assert odom_from_base is not None
            map_from_base = map_from_odom.compose(odom_from_base)
            assert (map_from_base.x_m, map_from_base.y_m) == pytest.approx((truth.x_m, truth.y_m), abs=0.1)

    asyncio.run(scenario())
