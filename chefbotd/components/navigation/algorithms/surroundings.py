"""The robot's surroundings when it chooses its next motion: points in its frame, and how they move."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, Singles
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record, replace

SWEEP_S = 0.25


class Surroundings(Record, frozen=True):
    """Points (n, 2) in the robot's frame, their velocities (same frame), and the least distance that each may have.

    ``fixed_m`` is the map's distance to obstacles, in which the robot is at ``grid_from_base``. ``intent_m_s`` is the
    expected velocity of each point: that of a person who waits for the robot is what it was before. ``speed_m_s`` is the
    robot's speed, and ``stops_m`` after what length of an arc it will stand. ``is_walker`` says which points belong to a
    person; None: all that move. A chair may seem to move a little while the robot drives past.
    """

    points_m: Floats
    velocity_m_s: Floats
    margin_m: Floats
    fixed_m: Singles
    cell_m: float
    grid_from_base: Pose2D
    intent_m_s: Floats | None = None
    speed_m_s: float = 0.0
    stops_m: float = math.inf
    is_walker: Flags | None = None


def standing_only(surroundings: Surroundings) -> Surroundings:
    """The same without what moves."""
    still = ~surroundings.velocity_m_s.any(axis=1)
    return replace(
        surroundings,
        points_m=surroundings.points_m[still],
        margin_m=surroundings.margin_m[still],
        is_walker=None,
        velocity_m_s=surroundings.velocity_m_s[still],
    )


def turn_surroundings(surroundings: Surroundings, angle_rad: float) -> Surroundings:
    """The surroundings of the robot after a turn on the spot by an angle (CCW positive)."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    turn_back = np.array([[cos, -sin], [sin, cos]])
    points_m, velocity_m_s = surroundings.points_m @ turn_back, surroundings.velocity_m_s @ turn_back
    pose = surroundings.grid_from_base.compose(Pose2D(0.0, 0.0, angle_rad))
    return replace(surroundings, points_m=points_m, velocity_m_s=velocity_m_s, grid_from_base=pose)


def sweep_movers(surroundings: Surroundings, foresight_s: float) -> Surroundings:
    """The same with what moves at every place of its path: a robot that lets it pass must stand clear of all of them."""
    moving = np.hypot(surroundings.velocity_m_s[:, 0], surroundings.velocity_m_s[:, 1]) > 0
    points, margin = surroundings.points_m[moving], surroundings.margin_m[moving]
    velocity = surroundings.velocity_m_s[moving]
    times = np.arange(0.0, foresight_s + 1e-9, SWEEP_S)
    along = [points + velocity * time_s for time_s in times]
    everything = np.vstack([surroundings.points_m[~moving], *along])
    margins = np.concatenate([surroundings.margin_m[~moving], np.tile(margin, len(times))])
    return replace(
        surroundings,
        points_m=everything,
        margin_m=margins,
        velocity_m_s=np.zeros_like(everything),
        is_walker=None,
    )
