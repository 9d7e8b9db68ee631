"""The wheels of a simulated robot, and where they are."""

import pytest

from chefbotd.components.simulation.chassis import Chassis, Scrub, Wheel
from chefbotd.core.geometry import Twist2D


def chassis(order: str) -> Chassis:
    """Wheels of 5 cm on these sides, in this order, 0.4 m apart."""
    return Chassis(tuple(Wheel(side == "L", 0.05) for side in order), 0.4, 1000)


def scrubbing(order: str, wheelbase_m: float, moving: Twist2D) -> list[float]:
    """What each axle pays when every wheel grips with 10 N."""
    wheels = chassis(order)
    return Scrub(wheels, wheelbase_m, [0.05] * len(order), 10.0).torque_n_m(moving)


@pytest.mark.parametrize("order", ["", "L", "RR"])
def test_a_side_without_a_wheel_is_refused(order: str) -> None:
    """A robot without a wheel on each side cannot be steered by them."""
    with pytest.raises(ValueError, match="at least one wheel on each side"):
        chassis(order)


def test_the_wheels_in_the_middle_are_not_dragged_and_help() -> None:
    """On the spot four wheels 0.3 m off the middle resist with 4 * 10 N * 0.3 m, overcome by six at 0.2 m: 10 N each."""
    torque_n_m = scrubbing("LLLRRR", 0.6, Twist2D(0.0, 1.0))
    assert torque_n_m == pytest.approx([10.0 * 0.05] * 6)


def test_only_the_sideways_share_of_the_way_costs() -> None:
    """At 0.4 m/s and 1 rad/s a wheel 0.3 m off goes 0.3 of every 0.5 m sideways: 0.6 of 15 N; straight on none."""
    assert scrubbing("LRLR", 0.6, Twist2D(0.4, 1.0)) == pytest.approx([0.6 * 15.0 * 0.05] * 4)
    assert not any(scrubbing("LRLR", 0.6, Twist2D(0.4, 0.0)))
    assert not any(scrubbing("LRLR", 0.6, Twist2D(0.0, 0.0)))
