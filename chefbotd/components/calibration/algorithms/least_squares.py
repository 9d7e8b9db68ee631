"""Robust nonlinear least squares with honest standard deviations, for a handful of parameters.

Levenberg and Marquardt's method with forward differences. Rows of residuals that are far off lose influence by the soft
L1 loss (Triggs et al., "Bundle Adjustment - A Modern Synthesis", 2000, section 3.1).
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.record import Record

Floats: TypeAlias = NDArray[np.float64]
Residuals: TypeAlias = Callable[[Floats], Floats]
"""Parameters (k,) to residuals (n, d) in standard deviations: the d of a row lose influence together."""

ITERATIONS, CONVERGED = 60, 1e-10
DIFFERENCE = 1e-6
SOFT_SIGMAS = 1.5
"""From about here on a row counts by its size, no longer by its square."""

UNDETERMINED = 1e-9
"""Determined by nothing: a parameter, or a direction among the scaled ones, with less of the largest's certainty."""


class Solution(Record, frozen=True):
    """The parameters (k,), their covariance (k, k), and the residuals (n, d) that are left.

    ``is_determined`` is whether the residuals determine all parameters.
    """

    values: Floats
    covariance: Floats
    residuals: Floats
    is_determined: bool

    @property
    def sigmas(self) -> Floats:
        """The standard deviation of each parameter."""
        sigmas: Floats = np.sqrt(np.diag(self.covariance))
        return sigmas


def solve(
    residuals: Residuals,
    start: Floats,
    *,
    prior_sigmas: Floats | None = None,
    shares: Floats | None = None,
    groups: NDArray[np.int64] | None = None,
) -> Solution:
    """The parameters with the least soft L1 loss, from ``start`` (k,) on.

    ``prior_sigmas`` (k,) keep parameters near ``start`` (infinite: free). ``shares`` (n,) are how much each row counts,
    1 by default. ``groups`` (n,) number the rows whose errors go together, such as those of one run; the covariance is
    then White's, clustered by group.
    """
    certainty = np.zeros(len(start)) if prior_sigmas is None else prior_sigmas**-2.0
    values, damping = start.astype(np.float64), 1e-4
    left = residuals(values)
    counts = np.ones(len(left)) if shares is None else shares
    cost = _cost(left, counts, values - start, certainty)
    for _ in range(ITERATIONS):
        slopes = _slopes(residuals, values, left)
        normal, gradient = _normal(slopes, left, counts, values - start, certainty)
        improved = False
        while not improved and damping < 1e8:
            step = -np.linalg.lstsq(
                normal + damping * np.diag(np.diag(normal) + 1e-12), gradient, rcond=None
            )[0]
            trial = residuals(values + step)
            trial_cost = _cost(trial, counts, values + step - start, certainty)
            improved = bool(trial_cost <= cost)
            damping *= 0.2 if improved else 8.0
        if not improved:
            break
        is_done = cost - trial_cost <= CONVERGED * (cost + 1e-12)
        values, left, cost = values + step, trial, trial_cost
        if is_done:
            break
    slopes = _slopes(residuals, values, left)
    normal, _ = _normal(slopes, left, counts, values - start, certainty)
    inverse, is_determined = _inverse(normal)
    if groups is not None:
        covariance = _cluster_covariance(inverse, slopes, left, counts, groups)
    else:
        covariance = _by_size(inverse, left, counts)
    return Solution(values, covariance, left, is_determined and len(left) > 0)


def loss(left: Floats) -> Floats:
    """The soft L1 loss of each row, twice what a square would have."""
    squared = (left**2).sum(axis=1) / SOFT_SIGMAS**2
    rows: Floats = 2 * SOFT_SIGMAS**2 * (np.sqrt(1 + squared) - 1)
    return rows


def _cost(left: Floats, shares: Floats, off: Floats, certainty: Floats) -> float:
    return float((shares * loss(left)).sum() + (certainty * off**2).sum())


def _weights(left: Floats) -> Floats:
    weights: Floats = 1 / np.sqrt(1 + (left**2).sum(axis=1) / SOFT_SIGMAS**2)
    return weights


def _slopes(residuals: Residuals, values: Floats, left: Floats) -> Floats:
    """The derivatives (n, d, k) of the residuals."""
    columns = []
    for k in range(len(values)):
        moved = values.copy()
        moved[k] += DIFFERENCE
        columns.append((residuals(moved) - left) / DIFFERENCE)
    return np.stack(columns, axis=-1)


def _normal(
    slopes: Floats, left: Floats, shares: Floats, off: Floats, certainty: Floats
) -> tuple[Floats, Floats]:
    weighted = slopes * (shares * _weights(left))[:, None, None]
    normal = np.einsum("ndk,ndl->kl", weighted, slopes) + np.diag(certainty)
    gradient = np.einsum("ndk,nd->k", weighted, left) + certainty * off
    return normal, gradient


def _inverse(normal: Floats) -> tuple[Floats, bool]:
    """The inverse of the normal matrix, with a huge variance where nothing is determined; and whether all is."""
    diagonal = np.diag(normal)
    most = max(float(diagonal.max()), 1e-300)
    scale = 1 / np.sqrt(np.maximum(diagonal, UNDETERMINED * most))
    eigenvalues, vectors = np.linalg.eigh(normal * scale * scale[:, None])
    inverse = (vectors / np.maximum(eigenvalues, 1e-12)) @ vectors.T * scale * scale[:, None]
    weakest = min(eigenvalues[0] / eigenvalues[-1], diagonal.min() / most)
    return inverse, bool(weakest > UNDETERMINED)


def _by_size(inverse: Floats, left: Floats, shares: Floats) -> Floats:
    """The covariance by the size of the residuals, if each is an error of its own."""
    weights = shares * _weights(left)
    spread = float((weights[:, None] * left**2).sum())
    degrees = max(float(shares.sum()) * left.shape[1] - len(inverse), 1.0)
    covariance: Floats = inverse * max(spread / degrees, 1e-12)
    return covariance


def _cluster_covariance(
    inverse: Floats, slopes: Floats, left: Floats, shares: Floats, groups: NDArray[np.int64]
) -> Floats:
    """The covariance by how the groups disagree, but none smaller than by the size of the residuals.

    White, "Maximum Likelihood Estimation of Misspecified Models", Econometrica 50, 1982; clustered as by Liang and
    Zeger, Biometrika 73, 1986. Few groups disagree too little with what was fitted to them: their number corrects it.
    """
    by_size = _by_size(inverse, left, shares)
    members = np.unique(groups, return_inverse=True)[1]
    scores = np.zeros((members.max() + 1, len(inverse)))
    np.add.at(
        scores, members, np.einsum("ndk,nd->nk", slopes * (shares * _weights(left))[:, None, None], left)
    )
    number, parameters = scores.shape
    if number <= parameters + 1:
        return by_size
    by_group = inverse @ (scores.T @ scores) @ inverse * number / (number - parameters)
    larger = np.sqrt(np.maximum(np.diag(by_group) / np.diag(by_size), 1.0))
    covariance: Floats = by_size * larger * larger[:, None]
    return covariance
