"""When a pose is doubted: scans that misfit, that say nothing, or that fit better elsewhere on the map.

What a step finds is weighed here; each function returns the next state, and the event if there was one.
"""

import math
from typing import Final

from chefbotd.components.localization.algorithms import searching as search_room
from chefbotd.components.localization.algorithms.agreement import Agreement
from chefbotd.components.localization.algorithms.global_search import is_same
from chefbotd.components.localization.algorithms.hypotheses import REFUTED_BY, Hypothesis, merge_hypotheses
from chefbotd.components.localization.algorithms.searching import LocalizationMap, Searching
from chefbotd.components.localization.algorithms.state import (
    Localization,
    PoseEvent,
    PoseState,
    given_up,
    is_sure,
    on_event,
)
from chefbotd.components.localization.algorithms.tracking import (
    MIN_OVERLAP,
    SUSPICIOUS_DROP,
    PoseEstimate,
    sigmas,
)
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.core.poses import Floats, between
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence

UNCERTAIN_AFTER_S: Final = 0.5
LOST_AFTER_S: Final = 1.5
LOST_AFTER_SCANS: Final = 5
"""A pose is given up when its scans misfit for so long, and are so many."""

NO_EVIDENCE_AFTER_S: Final = 10.0
"""A pose from which nothing is seen that the map knows is uncertain after so long; an uncertain one is given up."""

CONFIRMED_FIT: Final = 0.65
CONFIRMED_SCANS: Final = 3
"""So many scans in a row that fit so well end a doubt."""

CONTRADICTED_BY: Final = 0.08
"""A pose that was given is given up where another fits so much better; half of it is too much to confirm it."""

FIXED_SIGMA_M: Final = 0.1
"""A pose that was given is not confirmed while the scans leave it open by more, as along a bare corridor."""

DOUBTED_FIT: Final = 0.76
"""A pose that fits worse than this is uncertain until the whole map has been searched for a better place."""

DOUBTED_THROUGH: Final = 0.12
"""So large a share of beams through walls of the map has it searched as well: no person and no added chair does this."""

UNCERTAIN_FOR_S: Final = 3.0
"""A pose that was uncertain for so long counts as one that was only given: the map is searched again as it moves on."""

DOUBTED_AGAIN_M: Final = 2.0
"""After such a search it is not searched again for so far, unless the fit drops further."""


def doubt_pose(
    state: Localization, agreement: Agreement, odometry: Floats, stamp_s: float
) -> tuple[Localization, PoseEvent | None]:
    """Have the whole map searched when scans contradict a pose, or fit worse than usual, for a while.

    Where much does not fit, the pose is uncertain meanwhile.
    """
    fits_badly = agreement.fit < DOUBTED_FIT
    if not fits_badly and not state.misfits and agreement.contradiction <= DOUBTED_THROUGH:
        return replace(state, doubted_since_s=None), None
    if state.checked is not None:
        before, fit = state.checked
        motion = between(before, odometry)
        is_near = math.hypot(motion[0], motion[1]) < DOUBTED_AGAIN_M
        if is_near and agreement.fit >= fit - SUSPICIOUS_DROP:
            return state, None
    since_s = stamp_s if state.doubted_since_s is None else state.doubted_since_s
    state = replace(state, doubted_since_s=since_s)
    if stamp_s - since_s < UNCERTAIN_AFTER_S:
        return state, None
    state = replace(state, is_unchecked=True, doubted_since_s=None, searching=None)
    return (on_event(state, PoseEvent.MISFITS), PoseEvent.MISFITS) if fits_badly else (state, None)


def check_elsewhere(
    map_: LocalizationMap,
    state: Localization,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
) -> tuple[Localization, PoseEvent | None]:
    """Search the whole map, a bit further with each scan, for a place that contradicts a pose that is unchecked.

    A pose that was given is given up where another fits clearly better; one that was believed before, only where a
    search would refute it, because furniture that was moved costs the right place as much. One that has been uncertain
    for some seconds is no better than a given one. It is as good as found where none does, and where the scans tell
    where it is in every direction: along a bare corridor they do not.
    """
    last, estimate = state.searching, state.estimate
    if estimate is None or state.overlap < MIN_OVERLAP:
        return state, None
    since_s = state.uncertain_since_s
    is_doubtful = since_s is not None and stamp_s - since_s >= UNCERTAIN_FOR_S
    if last is None or _is_due_again(last, odometry, stamp_s, is_doubtful=is_doubtful):
        candidates = () if last is None else last.candidates
        last = search_room.start_search(map_, scan, odometry, stamp_s, candidates)
    else:
        last = search_room.add_scan(map_, last, odometry, scan)
    was_searched = last.search is None
    last = search_room.advance_search(map_, last, odometry)
    if last.search is None and not was_searched:
        given = Hypothesis(estimate, state.fit, state.overlap)
        last = replace(last, candidates=merge_hypotheses((given,), last.candidates))
    state = replace(state, searching=last)
    if last.search is not None:
        return state, None
    best = max((one.fit for one in last.candidates), default=0.0)
    own = max((one.fit for one in last.candidates if _is_at(one, estimate)), default=state.fit)
    scans = min((one.scans for one in last.candidates), default=0)
    was_found = state.checked is not None and not is_doubtful
    if own <= best - (REFUTED_BY if was_found else CONTRADICTED_BY):
        return given_up(state), PoseEvent.GIVEN_UP
    if scans < 2:
        return state, None
    is_fixed = was_found or sigmas(estimate.covariance)[0] <= FIXED_SIGMA_M
    if own <= best - CONTRADICTED_BY / 2 or not is_fixed:
        is_doubted = state.state is PoseState.LOCALIZED
        return (on_event(state, PoseEvent.MISFITS), PoseEvent.MISFITS) if is_doubted else (state, None)
    state = replace(state, searching=None, is_unchecked=False, checked=(odometry, state.fit))
    if state.state is PoseState.UNCERTAIN and state.fits >= CONFIRMED_SCANS and is_sure(estimate):
        return on_event(state, PoseEvent.FITS), PoseEvent.FITS
    return state, None


def _is_due_again(last: Searching, odometry: Floats, stamp_s: float, *, is_doubtful: bool) -> bool:
    """Whether there were too many places to follow all, or the pose is still doubtful, and the robot sees others now."""
    if last.search is not None or not search_room.has_moved_on(last, odometry):
        return False
    return not last.is_complete or (is_doubtful and stamp_s - last.began_s >= UNCERTAIN_FOR_S)


def _is_at(one: Hypothesis, estimate: PoseEstimate) -> bool:
    return is_same(one.estimate.pose, estimate.pose)


def doubt_sentence(state: Localization) -> str:
    """Why a pose is uncertain that was not given by somebody, and what is done about it; empty where it is not."""
    if state.state is not PoseState.UNCERTAIN or not state.is_unchecked or state.checked is None:
        return ""
    return Sentence(
        "localization.fits_worse",
        "the scans fit the pose worse than before: the whole map is searched for another place",
    )


def without_evidence(state: Localization, stamp_s: float) -> tuple[Localization, PoseEvent | None]:
    """A pose in space that the map does not know is carried by odometry for a while.

    After that it is uncertain, and after as long again it is given up.
    """
    since_s = stamp_s if state.no_evidence_since_s is None else state.no_evidence_since_s
    state = replace(state, no_evidence_since_s=since_s)
    if stamp_s - since_s < NO_EVIDENCE_AFTER_S:
        return state, None
    if state.state is PoseState.UNCERTAIN:
        return given_up(state), PoseEvent.GIVEN_UP
    state = replace(state, no_evidence_since_s=stamp_s)
    return on_event(state, PoseEvent.MISFITS), PoseEvent.MISFITS


def misfit(state: Localization, stamp_s: float, patience_s: float) -> tuple[Localization, PoseEvent | None]:
    """A pose whose scan fits badly is uncertain after a while, and given up after ``patience_s``."""
    since_s = stamp_s if state.misfit_since_s is None else state.misfit_since_s
    misfits = 1 if state.misfit_since_s is None else state.misfits + 1
    state = replace(state, misfit_since_s=since_s, misfits=misfits, fits=0)
    if stamp_s - since_s >= patience_s and misfits >= LOST_AFTER_SCANS:
        return given_up(state), PoseEvent.GIVEN_UP
    if stamp_s - since_s >= UNCERTAIN_AFTER_S and state.state is PoseState.LOCALIZED:
        return on_event(state, PoseEvent.MISFITS), PoseEvent.MISFITS
    return state, None
