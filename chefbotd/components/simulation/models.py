"""Simulation: the topic ``sim`` with the true pose of a simulated robot."""

from chefbotd.core.events import TruthSimulated
from chefbotd.core.record import Record
from chefbotd.rpc.topics import Topic


class SimulatedDisc(Record, frozen=True):
    """A person who walks around, or a thing that is on no map."""

    x_m: float
    y_m: float
    radius_m: float


class SimData(Record, frozen=True):
    """The true pose of the simulated robot in the world's frame, and the people and things around it."""

    x_m: float
    y_m: float
    heading_rad: float
    linear_m_s: float
    angular_rad_s: float
    in_contact: bool
    discs: tuple[SimulatedDisc, ...] = ()


def _sim(event: TruthSimulated) -> SimData:
    return SimData(
        x_m=event.world_from_base.x_m,
        y_m=event.world_from_base.y_m,
        heading_rad=event.world_from_base.heading_rad,
        linear_m_s=event.twist.linear_m_s,
        angular_rad_s=event.twist.angular_rad_s,
        in_contact=event.in_contact,
        discs=tuple([SimulatedDisc(x_m=x, y_m=y, radius_m=radius) for x, y, radius in event.discs]),
    )


TOPICS = (Topic("sim", (TruthSimulated,), SimData, _sim),)
