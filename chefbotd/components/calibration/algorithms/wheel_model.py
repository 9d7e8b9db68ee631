"""Dead reckoning of a whole drive at once, as a function of the wheels' parameters."""

import math

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.core.record import Record


class WheelModel(Record, frozen=True):
    """Factors on the configured radii of both sides and on the configured effective track.

    The track in force is ``track (1 + spin share)``, where the share of spin in a motion is 1 on the spot and 0 straight
    ahead: tyres that scrub make it wider or narrower, as the curve is tight or wide.
    """

    left: float = 1.0
    right: float = 1.0
    track: float = 1.0
    spin: float = 0.0

    @property
    def size(self) -> float:
        """The mean of both sides' factors."""
        return (self.left + self.right) / 2


NOMINAL = WheelModel()

PLAY_SIGMA_M = 2e-3
"""How much play gears are expected to have, at the rim: up to a few degrees of a small wheel (assumed)."""


def flanks(steps_m: Floats) -> Floats:
    """Against which flank a side's gears lie, before and after each step (n + 1,): 1 driving forward, -1 in reverse.

    From one to the other, the encoder turns by the play, and the wheel does not.
    """
    flank, reached = 0.0, [0.0]
    for step in (steps_m * 2 / PLAY_SIGMA_M).tolist():
        flank = min(max(flank + step, -1.0), 1.0)
        reached.append(flank)
    return np.array(reached)


def dead_reckon(model: WheelModel, track_m: float, left_m: Floats, right_m: Floats) -> Floats:
    """Poses (n + 1, 3) from (0, 0, 0) on; headings are not wrapped.

    ``left_m`` and ``right_m`` (n,) are how far the sides rolled in each step with the configured radii; ``track_m`` is
    the configured effective track. Each step is an arc.
    """
    left, right = left_m * model.left, right_m * model.right
    ahead_m, turning_m = (left + right) / 2, (right - left) / 2
    track = np.full(len(left), track_m * model.track)
    if model.spin:
        rolled_m = np.abs(ahead_m) + np.abs(turning_m)
        track *= 1 + model.spin * np.abs(turning_m) / np.maximum(rolled_m, 1e-12)
    turned_rad = 2 * turning_m / track
    heading_rad = np.concatenate([[0.0], np.cumsum(turned_rad)])
    chord_m = ahead_m * np.sinc(turned_rad / math.tau)
    along_rad = heading_rad[:-1] + turned_rad / 2
    poses = np.zeros((len(left) + 1, 3))
    poses[1:, 0] = np.cumsum(chord_m * np.cos(along_rad))
    poses[1:, 1] = np.cumsum(chord_m * np.sin(along_rad))
    poses[:, 2] = heading_rad
    return poses
