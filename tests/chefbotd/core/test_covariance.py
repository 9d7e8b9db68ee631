"""A covariance in another frame."""

import math

import pytest

from chefbotd.core.geometry import PoseCovariance


def test_an_uncertainty_ahead_becomes_one_to_the_left() -> None:
    """Turned by 90 degrees, what was uncertain along x (and went with the heading) is so along y."""
    turned = PoseCovariance(0.04, 0.0, 0.01, 0.0001, 0.0, 0.02).turned(math.pi / 2)
    assert turned.row_by_row == pytest.approx(PoseCovariance(0.0001, 0.0, 0.0, 0.04, 0.01, 0.02).row_by_row)


def test_turned_to_and_fro_it_is_the_same() -> None:
    """By 0.7 rad and back."""
    covariance = PoseCovariance(0.04, 0.01, 0.002, 0.03, 0.004, 0.02)
    assert covariance.turned(0.7).turned(-0.7).row_by_row == pytest.approx(covariance.row_by_row)
