"""Estimates the motion since the last scan: odometry, search and refinement against the growing submap."""

import math

import numpy as np

from chefbotd.components.mapping.algorithms.correlate import Window, search
from chefbotd.components.mapping.algorithms.local_map import LocalMap
from chefbotd.components.mapping.algorithms.parameters import MatchingParameters
from chefbotd.components.mapping.algorithms.refine import Fit, Prior, polish
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.core.poses import Floats, between, compose, invert
from chefbotd.core.record import Record

PENALTY = 0.01
"""What a pose one sigma off the odometry loses in score: ties in a bare corridor are for the odometry to break."""

SLIPPED_SIGMAS = 2.5
"""A match that is so far from the odometry is one of wheels that slipped."""

CAPTURE = 0.3
"""A match that scores less is none."""


class ScanMatch(Record, frozen=True):
    """The pose in the local frame with its covariance, and how the scan fits there.

    ``fits`` is whether it may be believed; ``slipped`` whether it lies where the odometry did not expect it.
    """

    fit: Fit
    covariance: Floats
    fits: bool
    slipped: bool = False


def track_scan(
    params: MatchingParameters,
    grids: LocalMap,
    last: Floats,
    moved: Floats,
    scan: Scan,
    usual_fit: float = 1.0,
    noise: Floats | None = None,
) -> ScanMatch:
    """The robot's pose: it was at ``last`` in the map's frame, and has moved by ``moved`` says the odometry.

    A fit that is clearly worse than the usual one has the scan searched further around: the wheels may have slipped.
    ``noise`` (3, 3) is the odometry's own covariance of the motion, for where it is less certain than usual.
    """
    sigma_m, sigma_rad = odometry_sigmas(params, moved)
    if noise is not None:
        sigma_m = max(sigma_m, math.sqrt(max(float(noise[0, 0]), float(noise[1, 1]), 0.0)))
        sigma_rad = max(sigma_rad, math.sqrt(max(float(noise[2, 2]), 0.0)))
    if math.hypot(moved[0], moved[1]) > params.max_jump_m:
        return _match_after_jump(params, grids, last, scan)
    guess = compose(last, moved)
    information = np.diag([sigma_m**-2, sigma_m**-2, sigma_rad**-2])
    window = Window(
        min(3 * sigma_m, params.max_window_m),
        min(3 * sigma_rad, params.max_window_rad),
        PENALTY / sigma_m**2,
        PENALTY / sigma_rad**2,
    )
    match = search(grids, scan.points, guess, window)
    begin = guess if match is None else match.pose
    fit = polish(grids, scan.points, scan.facing, begin, Prior(guess, information), params.laser_noise_m)
    covariance = invert(fit.information + information)
    if fit.overlap < params.min_overlap:
        return ScanMatch(fit, covariance, fits=fit.contradictions <= fit.inliers)
    if fit.share < max(usual_fit - params.suspicious_drop, params.fits_share):
        elsewhere = _match_after_slip(params, grids, (last, guess), scan)
        if elsewhere is not None and elsewhere.fit.share >= fit.share + params.better_share:
            return elsewhere
    fits = fit.share >= params.fits_share
    return ScanMatch(fit, covariance, fits, slipped=fits and _is_off(fit.pose, guess, sigma_m, sigma_rad))


def _is_off(pose: Floats, guess: Floats, sigma_m: float, sigma_rad: float) -> bool:
    """Whether the pose is where the odometry hardly lets it be."""
    off = between(guess, pose)
    far = math.hypot(off[0], off[1]) > SLIPPED_SIGMAS * sigma_m
    return far or abs(float(off[2])) > SLIPPED_SIGMAS * sigma_rad


def odometry_sigmas(params: MatchingParameters, moved: Floats) -> tuple[float, float]:
    """One sigma of place (m) and heading (rad) after such a motion."""
    way_m, turn_rad = math.hypot(moved[0], moved[1]), abs(moved[2])
    return (
        params.odometry_m + params.odometry_m_per_m * way_m + params.odometry_m_per_rad * turn_rad,
        params.odometry_rad + params.odometry_rad_per_rad * turn_rad + params.odometry_rad_per_m * way_m,
    )


def _match_after_jump(params: MatchingParameters, grids: LocalMap, last: Floats, scan: Scan) -> ScanMatch:
    """The odometry is not to be believed: look where the robot was."""
    track = _match_after_slip(params, grids, (last,), scan)
    if track is not None:
        return track
    prior = Prior(last, np.eye(3))
    fit = polish(grids, scan.points, scan.facing, last, prior, params.laser_noise_m)
    return ScanMatch(fit, invert(fit.information + prior.information), fits=False)


def _match_after_slip(
    params: MatchingParameters, grids: LocalMap, guesses: tuple[Floats, ...], scan: Scan
) -> ScanMatch | None:
    """Look further around, without the odometry: where the robot was, too, since wheels that slip get nowhere."""
    window = Window(params.wheel_slip_window_m, params.wheel_slip_window_rad)
    score, match = CAPTURE, None
    for guess in guesses:
        better = search(grids, scan.points, guess, window, above=score)
        if better is not None:
            score, match = better.score, better
    if match is None:
        return None
    prior = Prior(match.pose, np.diag([1.0, 1.0, 1.0]))
    fit = polish(grids, scan.points, scan.facing, match.pose, prior, params.laser_noise_m)
    if fit.share < params.wheel_slip_share or fit.overlap < 2 * params.min_overlap:
        return None
    return ScanMatch(fit, invert(fit.information + prior.information), fits=True, slipped=True)
