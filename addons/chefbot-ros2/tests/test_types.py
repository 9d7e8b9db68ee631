"""Which of ROS's message classes are installed: asked of ROS's own Python."""

import subprocess

import pytest
from chefbot_ros2.messages import TYPESTORE
from ros import ADVICE, PYTHON, environment

ASK = """
from sys import argv
from chefbot_ros2.types import class_of
for name in argv[1:]:
    kind = class_of(name)
    fields = kind and [f"{key}:{text}" for key, text in kind.get_fields_and_field_types().items()]
    print(name, fields and " ".join(field.partition(":")[0] for field in fields))
"""
PUBLISHED = [
    "diagnostic_msgs/msg/DiagnosticArray",
    "nav_msgs/msg/OccupancyGrid",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "sensor_msgs/msg/BatteryState",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Range",
    "std_msgs/msg/String",
    "tf2_msgs/msg/TFMessage",
]


def fields_in_ros(names: list[str]) -> dict[str, str]:
    """The fields of each message that ROS has, in their order; "None" where it is not installed."""
    assert PYTHON.exists(), ADVICE
    words = [str(PYTHON), "-c", ASK, *names]
    lines = subprocess.run(words, env=environment(), capture_output=True, text=True, check=True).stdout
    return dict(line.split(" ", 1) for line in lines.splitlines())


def test_what_is_encoded_here_has_the_fields_that_ros_decodes() -> None:
    """Messages leave as bytes: a field more or less on one side would be read as something else on the other."""
    in_ros = fields_in_ros(PUBLISHED)
    ours = {name: " ".join(field for field, _ in TYPESTORE.fielddefs[name][1]) for name in PUBLISHED}
    assert in_ros == ours


@pytest.mark.parametrize("name", ["nowhere_msgs/msg/Nothing"])
def test_a_package_that_is_not_installed_is_no_error(name: str) -> None:
    """As tf2_msgs where nobody built it: the node goes on without that topic."""
    assert fields_in_ros([name]) == {name: "None"}
