"""Simulation: the topic ``sim``, where a simulated robot really is."""

from chefbotd.core.events import TruthSimulated
from chefbotd.rpc.models import TopicData
from chefbotd.rpc.topics import Topic


class SimData(TopicData):
    """Where the simulated robot really is, in the world's frame."""

    x_m: float
    y_m: float
    heading_rad: float
    linear_m_s: float
    angular_rad_s: float
    in_contact: bool


def _sim(event: TruthSimulated) -> SimData:
    return SimData(
        x_m=event.world_from_base.x_m,
        y_m=event.world_from_base.y_m,
        heading_rad=event.world_from_base.heading_rad,
        linear_m_s=event.twist.linear_m_s,
        angular_rad_s=event.twist.angular_rad_s,
        in_contact=event.in_contact,
    )


TOPICS = (Topic("sim", (TruthSimulated,), SimData, _sim),)
