"""The robot's node, its wheels' frames, and RViz: ``ros2 launch launch.py connect:=HOST:PORT``."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

HERE = Path(__file__).parent
REMAPPED = ["--ros-args", "--remap", "scan/lidar:=scan"]


def generate_launch_description() -> LaunchDescription:
    """``connect`` is where chefbotd listens."""
    connect = DeclareLaunchArgument("connect", default_value="127.0.0.1:7333")
    bridge = ExecuteProcess(cmd=["chefbot-ros2", "--connect", LaunchConfiguration("connect"), *REMAPPED])
    rviz = ExecuteProcess(cmd=["rviz2", "-d", str(HERE / "chefbot.rviz")])
    return LaunchDescription([connect, bridge, rviz])
