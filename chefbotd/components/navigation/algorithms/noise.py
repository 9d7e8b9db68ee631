"""Which points of a lidar navigation believes, and how noisy the lidar is.

A point that no other beam and no earlier turn confirms may be nothing: sunlight, dust, a worn lidar. It is no obstacle
on the way, nobody who walks, and clears nothing. One that is near is believed at once: the robot brakes for it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.perception.lone_points import find_lone

BELIEVED_M: Final = 0.25
"""A point so near to the outline is believed at once: at 0.3 m/s the robot needs 0.2 m to stand, with its delay."""

TURNS: Final = 2
"""A point may be confirmed by so many earlier turns."""

LEARNT: Final = 0.05
"""The share of one turn in the noise."""

NOISY_SHARE: Final = 0.005
"""From here on the lidar is said to be noisy; a healthy one has less than a third of it."""

Flags = NDArray[np.bool_]


class Noise(Record, frozen=True):
    """All points of the last turns, in the grid's frame, and the share of points lately that nothing confirms."""

    turns: tuple[Floats, ...] = ()
    share: float = 0.0


def noise_sentence(share: float) -> str:
    """What is said about a lidar with this share of points that nothing confirms; empty: it is healthy."""
    return (
        Sentence(
            "navigation.noisy",
            "the lidar is noisy: {share_percent:.0f}% of its points are confirmed by no other beam",
            share_percent=100 * share,
        )
        if share >= NOISY_SHARE
        else ""
    )


def find_confirmed(noise: Noise, points_m: Floats, sensor_m: Floats) -> Flags:
    """Which points (n, 2) of a turn another beam or an earlier turn confirms."""
    if not len(points_m):
        return np.ones(0, np.bool_)
    sensor = sensor_m if len(sensor_m) == len(points_m) else sensor_m[0]
    return ~find_lone(points_m, sensor, earlier=noise.turns)


def after_turn(noise: Noise, points_m: Floats, is_noise: Flags) -> Noise:
    """The noise after a turn with these points, of which some are nothing that anybody knows of."""
    share = noise.share
    if len(noise.turns) == TURNS and len(points_m):
        share += LEARNT * (float(is_noise.mean()) - share)
    return Noise((points_m, *noise.turns)[:TURNS], share)
