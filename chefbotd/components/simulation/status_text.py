"""The row of chefbotctl's status for a simulated robot."""

from chefbotd.cli.common.state_text import Data, Fact, pose
from chefbotd.core.geometry import Pose2D


def truth(data: Data) -> Fact:
    """Where a simulated robot really is."""
    text = pose(Pose2D(data["x_m"], data["y_m"], data["heading_rad"]))
    return Fact("truth", text + (", touching a wall" if data["in_contact"] else ""))
