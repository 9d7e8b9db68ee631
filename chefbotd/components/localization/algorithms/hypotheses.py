"""Follows all possible places of the robot until only one is left.

A place is refuted when its scans do not fit, or fit clearly worse than at another place. Places that fit nearly as
well all stay: a chair that was moved costs the right room more than its look-alike.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.localization.algorithms.agreement import agreement
from chefbotd.components.localization.algorithms.global_search import is_same
from chefbotd.components.localization.algorithms.tracking import (
    LASER_NOISE_M,
    PoseEstimate,
    predict_pose,
    sigmas,
    track_pose,
)
from chefbotd.components.mapping.algorithms.correlate import ScoredPose
from chefbotd.components.mapping.algorithms.local_map import LocalMap
from chefbotd.components.mapping.algorithms.refine import Prior, polish
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.core.poses import Floats
from chefbotd.core.record import Record, replace

PLACE_M, PLACE_RAD = 0.15, 0.08
"""One sigma of a place that a search found, before its scan is polished."""


REFUTED_FIT: Final = 0.5
"""A place whose scans fit worse is refuted."""

REFUTED_BY: Final = 0.2
"""So is one that fits so much worse than the best."""

RIVAL_WITHIN: Final = 0.1
"""While another place fits worse by less than this, none is sure."""

SURE_FIT: Final = 0.88
"""What fits so well is sure after some scans, even without motion."""

MOVING_FIT: Final = 0.75
"""What fits so well is sure after having been seen so from several places."""

SURE_SCANS: Final = 4
SURE_LOOKS: Final = 8
LOOK_M: Final = 0.2
LOOK_RAD: Final = 0.5
"""After so much motion a scan is another look."""

SURE_OVERLAP: Final = 0.5
VAGUE_M: Final = 0.3
"""What a scan leaves open by more, as along a bare corridor, is not sure."""


class Hypothesis(Record, frozen=True):
    """A place where the robot might be: how well its scans fit (smoothed), and how many, from how many places."""

    estimate: PoseEstimate
    fit: float
    overlap: float
    scans: int = 1
    looks: int = 1


FIT_SHARE = 0.3
"""What the newest scan counts in the smoothed fit."""


def hypotheses(
    grids: LocalMap,
    places: tuple[ScoredPose, ...],
    scan: Scan,
) -> tuple[Hypothesis, ...]:
    """The places that the scan they were found for fits, once it is polished."""
    vague = np.diag([PLACE_M**2, PLACE_M**2, PLACE_RAD**2])
    matching = []
    for place in places:
        prior = Prior(place.pose, np.linalg.inv(vague))
        fit = polish(grids, scan.points, scan.facing, place.pose, prior, LASER_NOISE_M)
        scan_agreement = agreement(grids, fit.pose, scan)
        if scan_agreement.fit >= REFUTED_FIT:
            matching.append(
                Hypothesis(PoseEstimate(fit.pose, vague), scan_agreement.fit, scan_agreement.overlap)
            )
    return tuple(sorted(matching, key=lambda one: -one.fit))


def move_hypotheses(
    among: tuple[Hypothesis, ...], motion: Floats, noise: Floats | None
) -> tuple[Hypothesis, ...]:
    """All places after a motion."""
    return tuple(replace(one, estimate=predict_pose(one.estimate, motion, noise)) for one in among)


def confront_with_scan(
    grids: LocalMap,
    among: tuple[Hypothesis, ...],
    scan: Scan,
    *,
    is_look: bool,
) -> tuple[Hypothesis, ...]:
    """What is left after a scan, the best first; ``is_look`` says that the robot has moved since the last look."""
    seen = []
    for one in among:
        track = track_pose(grids, one.estimate, scan, may_search=False)
        fit = (1 - FIT_SHARE) * one.fit + FIT_SHARE * track.agreement.fit
        seen.append(
            Hypothesis(track.estimate, fit, track.agreement.overlap, one.scans + 1, one.looks + int(is_look))
        )
    best = max((one.fit for one in seen), default=0.0)
    least = max(REFUTED_FIT, best - REFUTED_BY)
    return merge_hypotheses((), tuple(one for one in seen if one.fit >= least))


def merge_hypotheses(old: tuple[Hypothesis, ...], new: tuple[Hypothesis, ...]) -> tuple[Hypothesis, ...]:
    """Both, the best first, without those of the new that are the same as one before."""
    kept = list(old)
    for one in sorted(new, key=lambda one: -one.fit):
        if not any(is_same(one.estimate.pose, other.estimate.pose) for other in kept):
            kept.append(one)
    return tuple(sorted(kept, key=lambda one: -one.fit))


def is_look(motion: Floats) -> bool:
    """Whether so much motion makes another look."""
    return math.hypot(motion[0], motion[1]) >= LOOK_M or abs(float(motion[2])) >= LOOK_RAD


def likely(among: tuple[Hypothesis, ...]) -> tuple[Hypothesis, ...]:
    """The places that fit as well as the best, or nearly: where the robot may well be."""
    return tuple(one for one in among if one.fit > among[0].fit - RIVAL_WITHIN)


def sure(among: tuple[Hypothesis, ...], *, is_complete: bool) -> Hypothesis | None:
    """The place that is believed, if there is one; the best is first.

    If there were more places than can be followed (not ``is_complete``), only motion makes one sure.
    """
    if not among:
        return None
    best = among[0]
    if len(likely(among)) > 1:
        return None
    if best.overlap < SURE_OVERLAP or sigmas(best.estimate.covariance)[0] > VAGUE_M:
        return None
    standing = is_complete and best.fit >= SURE_FIT and best.scans >= SURE_SCANS
    moving = best.fit >= MOVING_FIT and best.looks >= SURE_LOOKS
    return best if standing or moving else None
