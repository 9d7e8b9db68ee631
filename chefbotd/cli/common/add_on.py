"""The add-on for ROS 2, which some commands use where it is installed."""

from importlib import import_module
from typing import Any

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.extras import how_to_add_folder


def ros2_add_on(module: str) -> Any:
    """A module of the package chefbot_ros2.

    Raises:
        ProgramError: it is not installed.
    """
    try:
        return import_module(f"chefbot_ros2.{module}")
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] not in ("chefbot_ros2", "rosbags"):
            raise
        advice = f"in a checkout of chefbotd, {how_to_add_folder('./addons/chefbot-ros2')}"
        raise ProgramError(Exit.NOT_INSTALLED, f"a package is missing ({error}): {advice}") from error
