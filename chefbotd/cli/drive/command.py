"""A command that is sent again and again, by a program that follows a course."""

from chefbotd.client import CallError, Client
from chefbotd.core.geometry import Twist2D


async def send_drive(robot: Client, twist: Twist2D) -> None:
    """Drive so. A command that was refused as too late moved nothing, and the next one follows in a moment.

    That happens on a busy computer. Raises the client's other errors.
    """
    try:
        await robot.drive(twist.linear_m_s, twist.angular_rad_s)
    except CallError as error:
        if error.kind != "too_old":
            raise
