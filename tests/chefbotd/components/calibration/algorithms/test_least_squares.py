"""Robust least squares: a line by hand, an outlier, honest standard deviations, and what nothing determines."""

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms.least_squares import Floats, Residuals, solve

X = np.arange(10.0)


def _line(y: Floats, sigma: float = 1.0) -> Residuals:
    """Residuals of y = a + b x in standard deviations."""
    return lambda ab: ((ab[0] + ab[1] * X - y) / sigma)[:, None]


def test_a_line_through_points_on_it() -> None:
    """Y = 2 + 3 x is found from (0, 0) on."""
    solution = solve(_line(2 + 3 * X), np.zeros(2))
    assert solution.values == pytest.approx([2.0, 3.0], abs=1e-6)
    assert solution.is_determined


def test_an_outlier_hardly_counts() -> None:
    """One point that is 1000 sigmas off moves the slope by less than a tenth; squares would move it by 18."""
    y = 2 + 3 * X
    y[9] += 1000
    assert solve(_line(y), np.array([2.0, 3.0])).values[1] == pytest.approx(3.0, abs=0.1 * 3)


def test_the_standard_deviation_is_that_of_many_fits() -> None:
    """Of 300 fits to noise of 0.1, the slopes scatter as each fit says: by 0.1 / sqrt(82.5) = 0.011."""
    random = np.random.default_rng(1)
    fits = [solve(_line(2 + 3 * X + random.normal(0, 0.1, 10), 0.1), np.zeros(2)) for _ in range(300)]
    scatter = np.std([fit.values[1] for fit in fits])
    assert scatter == pytest.approx(0.011, rel=0.15)
    assert np.sqrt(np.mean([fit.sigmas[1] ** 2 for fit in fits])) == pytest.approx(scatter, rel=0.15)


def test_rows_that_repeat_each_other_do_not_make_it_surer() -> None:
    """Twenty measurements, each repeated 50 times: grouped, the mean is known to 1 / sqrt(20), not 1 / sqrt(1000)."""
    random = np.random.default_rng(2)
    y, groups = np.repeat(random.normal(0, 1, 20), 50), np.repeat(np.arange(20), 50)
    solution = solve(lambda mean: (mean[0] - y)[:, None], np.zeros(1), groups=groups)
    assert solution.sigmas[0] == pytest.approx(20**-0.5, rel=0.3)


def test_what_nothing_determines_is_named_so() -> None:
    """Of a sum of two parameters, neither is determined; with a prior on one of them both are."""
    sum_of = lambda ab: np.full((5, 1), ab[0] + ab[1] - 1.0)  # noqa: E731
    assert not solve(sum_of, np.zeros(2)).is_determined
    held = solve(sum_of, np.zeros(2), prior_sigmas=np.array([np.inf, 0.01]))
    assert held.is_determined
    assert held.values == pytest.approx([1.0, 0.0], abs=1e-4)
