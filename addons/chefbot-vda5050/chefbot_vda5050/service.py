"""Puts a robot into a fleet: the broker, the robot and the order's steps together."""

import asyncio
import math
from functools import partial

from msgspec import Struct

from chefbot_vda5050 import versions
from chefbot_vda5050.agent import VERSION, Agent
from chefbot_vda5050.broker import Broker, BrokerParameters
from chefbot_vda5050.chefbot import ChefBot, Connect
from chefbot_vda5050.factsheet import factsheet, physical
from chefbot_vda5050.topics import Headers, RobotName
from chefbot_vda5050.vehicle import Limits
from chefbotd.settings import Settings


class Parameters(Struct, frozen=True):
    """One robot: what it is called, its broker, and its configuration where that is known.

    ``version`` is what its messages say of themselves: masters of 2.0 are known that want to read 2.0.0.
    """

    name: RobotName
    broker: BrokerParameters
    settings: Settings | None = None
    carries_kg: float = 0.0
    order_max_age_s: float = 10.0
    visualization_s: float = 1.0
    version: str = VERSION


def limits(settings: Settings | None, order_max_age_s: float) -> Limits:
    """What the robot can do, by its configuration; unknown without one."""
    if settings is None:
        return Limits(order_max_age_s=order_max_age_s)
    values = physical(settings)
    half_m = settings.chassis.track_width_m / 2
    turn_rad_s = min(settings.limits.angular.max_left_rad_s, settings.drive.max_rim_speed_m_s / half_m)
    return Limits(
        speed_max_m_s=values["speedMax"],
        turn_max_rad_s=turn_rad_s,
        height_m=values["heightMax"] if settings.body else math.inf,
        order_max_age_s=order_max_age_s,
    )


async def serve(parameters: Parameters, connect: Connect) -> None:
    """Work until cancelled."""
    headers = Headers(parameters.name, parameters.version)
    robot = ChefBot(connect, version=versions.of(parameters.version))
    make = partial(
        factsheet,
        parameters.settings,
        carries_kg=parameters.carries_kg,
        seconds=parameters.visualization_s,
    )
    agent = Agent(
        parameters.name,
        robot,
        lambda kind, data: broker.publish(kind, data),
        factsheet=make,
        limits=limits(parameters.settings, parameters.order_max_age_s),
        visualization_s=parameters.visualization_s,
        headers=headers,
    )

    broker = Broker(
        parameters.broker,
        parameters.name,
        headers,
        receive=lambda kind, data, retained: agent.receive(kind, data, retained=retained),
        online=agent.set_online,
    )
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(robot.run())
        tasks.create_task(agent.run())
        tasks.create_task(broker.run())
