"""What localization knows: a value that each step replaces; its states are a table, with the events that change them."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

import numpy as np

from chefbotd.components.localization.algorithms.hypotheses import move_hypotheses
from chefbotd.components.localization.algorithms.searching import Searching
from chefbotd.components.localization.algorithms.tracking import (
    PoseEstimate,
    motion_noise,
    predict_pose,
    sigmas,
)
from chefbotd.core.poses import Floats, between, motion_covariance
from chefbotd.core.record import Record, replace


class PoseState(StrEnum):
    """``unknown``: nothing looked at yet. ``searching``: looking everywhere, or telling look-alike places apart.

    ``localized``: the scans fit. ``uncertain``: they do not fit just now, or a pose was given and is not confirmed yet.
    ``lost``: it knows that it does not know, and will look again.
    """

    UNKNOWN = "unknown"
    SEARCHING = "searching"
    LOCALIZED = "localized"
    UNCERTAIN = "uncertain"
    LOST = "lost"


class PoseEvent(StrEnum):
    """What happens to localization.

    ``pose_given``: by a person, or kept from before a restart. ``found``: a search leaves one place only.
    ``not_found``: it leaves none. ``fits`` and ``misfits``: some scans in a row. ``given_up``: they misfit for long.
    """

    POSE_GIVEN = "pose_given"
    SEARCH_STARTED = "search_started"
    FOUND = "found"
    NOT_FOUND = "not_found"
    FITS = "fits"
    MISFITS = "misfits"
    GIVEN_UP = "given_up"


NEXT: Mapping[tuple[PoseState, PoseEvent], PoseState] = {
    (PoseState.UNKNOWN, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.UNKNOWN, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.UNKNOWN, PoseEvent.FOUND): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.NOT_FOUND): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.FITS): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.MISFITS): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.GIVEN_UP): PoseState.UNKNOWN,
    (PoseState.SEARCHING, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.SEARCHING, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.SEARCHING, PoseEvent.FOUND): PoseState.LOCALIZED,
    (PoseState.SEARCHING, PoseEvent.NOT_FOUND): PoseState.LOST,
    (PoseState.SEARCHING, PoseEvent.FITS): PoseState.SEARCHING,
    (PoseState.SEARCHING, PoseEvent.MISFITS): PoseState.SEARCHING,
    (PoseState.SEARCHING, PoseEvent.GIVEN_UP): PoseState.SEARCHING,
    (PoseState.LOCALIZED, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.LOCALIZED, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.LOCALIZED, PoseEvent.FOUND): PoseState.LOCALIZED,
    (PoseState.LOCALIZED, PoseEvent.NOT_FOUND): PoseState.LOCALIZED,
    (PoseState.LOCALIZED, PoseEvent.FITS): PoseState.LOCALIZED,
    (PoseState.LOCALIZED, PoseEvent.MISFITS): PoseState.UNCERTAIN,
    (PoseState.LOCALIZED, PoseEvent.GIVEN_UP): PoseState.LOST,
    (PoseState.UNCERTAIN, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.UNCERTAIN, PoseEvent.FOUND): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.NOT_FOUND): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.FITS): PoseState.LOCALIZED,
    (PoseState.UNCERTAIN, PoseEvent.MISFITS): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.GIVEN_UP): PoseState.LOST,
    (PoseState.LOST, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.LOST, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.LOST, PoseEvent.FOUND): PoseState.LOST,
    (PoseState.LOST, PoseEvent.NOT_FOUND): PoseState.LOST,
    (PoseState.LOST, PoseEvent.FITS): PoseState.LOST,
    (PoseState.LOST, PoseEvent.MISFITS): PoseState.LOST,
    (PoseState.LOST, PoseEvent.GIVEN_UP): PoseState.LOST,
}

HAS_POSE = frozenset({PoseState.LOCALIZED, PoseState.UNCERTAIN})
"""The states in which there is one pose that is tracked."""


MAX_SIGMA_M: Final = 0.5
MAX_SIGMA_RAD: Final = 0.5
"""An estimate that is less sure than this is uncertain, whatever fits."""

GIVEN_SIGMA_M: Final = 0.3
GIVEN_SIGMA_RAD: Final = 0.2
"""One sigma of a pose that a person gives."""


class Odometry(Record, frozen=True):
    """``odom_from_base`` at the scan's stamp; its covariance (3, 3) in ``odom``, if the odometry tells one."""

    pose: Floats
    covariance: Floats | None = None


class Localization(Record, frozen=True):
    """All that the next step needs; ``published`` is the last ``map_from_odom``, of the time ``published_s``.

    Its pose has been uncertain since ``uncertain_since_s``.

    ``misfits`` counts scans in a row that fit badly or worse than usual, ``fits`` those that fit well. Since
    ``no_evidence_since_s`` scans have seen nothing that the map knows. A pose that was given, or
    whose scans have contradicted the map since ``doubted_since_s``, ``is_unchecked`` until the whole map has been
    searched for a place that fits better. ``checked`` is where the odometry was at the end of it, and the fit.
    """

    state: PoseState = PoseState.UNKNOWN
    estimate: PoseEstimate | None = None
    odometry: Odometry | None = None
    searching: Searching | None = None
    usual_fit: float = 1.0
    fit: float = 0.0
    overlap: float = 0.0
    misfits: int = 0
    misfit_since_s: float | None = None
    no_evidence_since_s: float | None = None
    fits: int = 0
    published: Floats | None = None
    published_s: float = 0.0
    is_unchecked: bool = False
    doubted_since_s: float | None = None
    uncertain_since_s: float | None = None
    checked: tuple[Floats, float] | None = None


def set_pose(state: Localization, pose: Floats, covariance: Floats | None = None) -> Localization:
    """The robot is about here, says a person or what was kept before a restart; the next scans confirm it or not.

    Raises:
        ValueError: the pose is not three finite numbers.
    """
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"a pose is x, y and heading, got {pose.tolist()}")
    vague = np.diag([GIVEN_SIGMA_M**2, GIVEN_SIGMA_M**2, GIVEN_SIGMA_RAD**2])
    estimate = PoseEstimate(pose.astype(np.float64), vague if covariance is None else covariance)
    return on_event(replace(forgotten(state), estimate=estimate, is_unchecked=True), PoseEvent.POSE_GIVEN)


def localize(state: Localization) -> Localization:
    """Search everywhere, whatever is known."""
    return on_event(forgotten(state), PoseEvent.SEARCH_STARTED)


def on_another_grid(state: Localization) -> Localization:
    """The map was edited where the robot knows it: a search begins again, and how well scans fit is learned anew."""
    return replace(state, searching=None, checked=None, usual_fit=0.0, misfits=0, misfit_since_s=None)


def forgotten(state: Localization) -> Localization:
    """Without what is believed about the pose; what was published stays."""
    return Localization(
        state=state.state, odometry=state.odometry, published=state.published, published_s=state.published_s
    )


def on_event(state: Localization, event: PoseEvent) -> Localization:
    """In the state that follows on the event."""
    return replace(state, state=NEXT[state.state, event])


def given_up(state: Localization) -> Localization:
    """Without its pose, which is wrong."""
    return replace(on_event(state, PoseEvent.GIVEN_UP), estimate=None, searching=None, is_unchecked=False)


def is_sure(estimate: PoseEstimate) -> bool:
    """Whether the estimate is known to half a metre and half a radian."""
    sigma_m, sigma_rad = sigmas(estimate.covariance)
    return sigma_m <= MAX_SIGMA_M and sigma_rad <= MAX_SIGMA_RAD


def carry_estimate(state: Localization, odometry: Odometry) -> Localization:
    """The estimate and all candidates after the motion since the last step."""
    if state.odometry is None:
        return replace(state, odometry=odometry)
    motion = between(state.odometry.pose, odometry.pose)
    noise = _noise(state.odometry, odometry)
    state = replace(state, odometry=odometry)
    if not motion.any():
        return state
    if state.estimate is not None:
        state = replace(state, estimate=predict_pose(state.estimate, motion, noise))
    if state.searching is not None and state.searching.candidates:
        candidates = move_hypotheses(state.searching.candidates, motion, noise)
        state = replace(state, searching=replace(state.searching, candidates=candidates))
    return state


def _noise(before: Odometry, after: Odometry) -> Floats | None:
    """The covariance of the motion where odometry is less certain than it is thought to be anyway, else None.

    It does not know of every slip. So what it says can make the motion less certain, and not more.
    """
    if before.covariance is None or after.covariance is None:
        return None
    noise = motion_covariance(before.pose, before.covariance, after.pose, after.covariance)
    if noise is None:
        return None
    usual, own = np.diag(motion_noise(between(before.pose, after.pose))), np.diag(noise)
    return np.diag(np.maximum(usual, own)) if (own > usual).any() else None
