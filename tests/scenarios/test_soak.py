"""A few minutes of the soak, and that it can fail; `make soak` drives an hour with each robot."""

from collections.abc import Callable
from typing import Any

import pytest

from chefbotd.core.record import replace
from chefbotd.motion import limits
from chefbotd.safety import encoder_timeout, gate
from tests.budget import sample
from tests.scenarios.robots import SKETCHED
from tests.scenarios.soak import soak


@pytest.mark.parametrize(
    ("robot", "seed", "minutes"),
    [
        ("chefbot", 1, 3.0),
        ("chefbot", 2, 3.0),
        ("khan", 1, 3.0),
        # Ours is heard to stop by itself after each fault, so less of a short run is driven.
        *((sketch, 3, 5.0 if sketch == "chefbot/chefbot" else 1.5) for sketch in SKETCHED[1:]),
    ],
)
@pytest.mark.slow
def test_nothing_breaks_in_minutes_of_faults(robot: str, seed: int, minutes: float):
    """Seeded faults at random: no motion while disarmed, setpoints within limits, odometry near the truth."""
    report = soak(minutes, seed, robot)
    assert report.control_steps > 700 * minutes
    assert report.faults.total() > 5
    assert report.travelled_m > minutes


def always_armed(check: Callable[..., Any]) -> Callable[..., Any]:
    """The gate without its modes."""
    return lambda parameters, state, *rest: check(parameters, replace(state, mode=gate.Mode.ARMED), *rest)


@pytest.mark.parametrize(
    ("module", "broken", "complaint"),
    sample(
        [
            (
                gate,
                {"accept": always_armed(gate.accept), "decide": always_armed(gate.decide)},
                "on the wire while|because it was armed",
            ),
            (
                encoder_timeout,
                {"is_stale": lambda params, state, now_s: False},
                "drives without being able to see",
            ),
            (limits, {"advance": lambda axis, speed, rate, aim, dt_s: (aim, 0.0)}, "setpoint changed by"),
        ]
    ),
    ids=["modes", "encoders", "ramps"],
)
def test_what_does_not_hold_is_told(
    monkeypatch: pytest.MonkeyPatch, module: object, broken: dict[str, object], complaint: str
):
    """A gate that moves a disarmed robot, blind driving, setpoints that jump: each ends the soak and is named."""
    for name, function in broken.items():
        monkeypatch.setattr(module, name, function)
    with pytest.raises(AssertionError, match=complaint):
        soak(10.0, 1)
