"""A gamepad's buttons and stick turned into orders."""

from dataclasses import dataclass

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.cli.drive.gamepad import (
    INITIAL_PAD,
    Button,
    Order,
    Pad,
    PadReading,
    PadRequest,
    StickScale,
    deflection,
    disable_pad,
    step,
)
from chefbotd.core.geometry import STANDING, Twist2D
from tests.budget import examples

SCALE = StickScale(linear_m_s=0.2, angular_rad_s=0.8, turbo=2.0, dead_zone=0.1)
AHEAD = Twist2D(0.2, 0.0)


def reading(*down: Button, forward: float = 0.0, left: float = 0.0) -> PadReading:
    """A look at a pad with these buttons down."""
    return PadReading(forward, left, frozenset(down))


@dataclass
class Driver:
    """Holds a pad; each look is 10 ms after the last."""

    pad: Pad = INITIAL_PAD
    now_s: float = 100.0
    look_s: float = 0.01

    def looks(self, *readings: PadReading | None) -> list[Order]:
        """The orders of these looks."""
        asked: list[Order] = []
        for one in readings:
            self.pad, orders = step(SCALE, self.pad, one, self.now_s)
            asked += orders
            self.now_s += self.look_s
        return asked


def test_nothing_moves_without_the_button() -> None:
    """The stick alone asks for nothing."""
    assert Driver().looks(reading(), reading(forward=1.0), reading(Button.TURBO, left=1.0)) == []


def test_the_button_must_be_seen_up_first() -> None:
    """Held down from the beginning it enables nothing; let go and pressed again it does."""
    held = reading(Button.ENABLE, forward=1.0)
    driver = Driver()
    assert driver.looks(held, held) == []
    assert driver.looks(reading(), held) == [AHEAD]


def test_letting_go_is_told_once() -> None:
    """One order when the button goes up, whatever the stick says, and then silence; it is no stop for everybody."""
    driver = Driver()
    driver.looks(reading(), reading(Button.ENABLE, forward=1.0))
    assert driver.looks(reading(forward=1.0), reading(forward=1.0)) == [PadRequest.RELEASE]


def test_velocities_are_repeated_at_20_hz() -> None:
    """Of 100 looks in a second 20 ask: at once, and then every 50 ms."""
    driver = Driver()
    driver.looks(reading())
    assert driver.looks(*[reading(Button.ENABLE, forward=1.0)] * 100) == [AHEAD] * 20


@pytest.mark.parametrize("look_s", [0.003, 0.011, 0.0125, 0.017, 0.03, 0.049])
def test_20_hz_do_not_depend_on_when_looks_come(look_s: float) -> None:
    """In ten seconds 200 turns, one more or less, however the looks fall between them."""
    driver = Driver(look_s=look_s)
    driver.looks(reading())
    asked = driver.looks(*[reading(Button.ENABLE, forward=1.0)] * round(10.0 / look_s))
    assert len(asked) == pytest.approx(200, abs=1)


def test_turns_that_were_missed_are_not_made_up_for() -> None:
    """After 0.32 s without a look one velocity is asked for, and the next on the old grid, 30 ms later."""
    driver = Driver()
    held = reading(Button.ENABLE, forward=1.0)
    driver.looks(reading(), held)
    began_s = driver.now_s - driver.look_s
    driver.now_s = began_s + 0.32
    assert driver.looks(held, held, held) == [AHEAD]
    driver.now_s = began_s + 0.3501
    assert driver.looks(held, held) == [AHEAD]


def test_the_stick_let_go_is_told_at_once() -> None:
    """Standing does not wait for the next turn; another speed does."""
    driver = Driver()
    driver.looks(reading(), reading(Button.ENABLE, forward=1.0))
    assert driver.looks(reading(Button.ENABLE, forward=0.5)) == []
    assert driver.looks(reading(Button.ENABLE)) == [STANDING]


def test_turbo_is_twice_as_fast() -> None:
    """Full stick back and left with turbo: -0.4 m/s and 1.6 rad/s."""
    driver = Driver()
    driver.looks(reading())
    down = (Button.ENABLE, Button.TURBO)
    assert driver.looks(reading(*down, forward=-1.0, left=1.0)) == [Twist2D(-0.4, 1.6)]


@pytest.mark.parametrize(
    ("button", "demands"),
    [
        (Button.ESTOP, [PadRequest.ESTOP]),
        (Button.STOP, [PadRequest.STOP]),
        (Button.ARM, [PadRequest.RELEASE, PadRequest.ARM]),
    ],
)
def test_presses_that_are_no_velocity(button: Button, demands: list[PadRequest]) -> None:
    """Each press is told once, ends the motion (arming alone would not), and needs the enable button anew."""
    driver = Driver()
    driver.looks(reading(), reading(Button.ENABLE, forward=1.0))
    both = reading(Button.ENABLE, button, forward=1.0)
    assert driver.looks(both, both, reading(Button.ENABLE, forward=1.0)) == demands
    assert driver.looks(reading(), reading(Button.ENABLE, forward=1.0)) == [AHEAD]


@pytest.mark.parametrize("button", [Button.STOP, Button.ESTOP, Button.ARM])
def test_presses_need_no_enable_button(button: Button) -> None:
    """Whoever holds the pad can stop the robot that another drives, and arm it."""
    assert Driver().looks(reading(), reading(button)) == [PadRequest(button)]


def test_of_presses_at_once_the_safest_counts() -> None:
    """The emergency stop before the stop, the stop before arming."""
    for buttons, request in (
        ((Button.ESTOP, Button.STOP, Button.ARM), PadRequest.ESTOP),
        ((Button.STOP, Button.ARM), PadRequest.STOP),
    ):
        assert Driver().looks(reading(), reading(*buttons)) == [request]


def test_a_pad_that_goes_lets_go() -> None:
    """Unplugged while driving: one order; plugged in again with the button held: nothing."""
    driver = Driver()
    driver.looks(reading(), reading(Button.ENABLE, forward=1.0))
    assert driver.looks(None, None, reading(Button.ENABLE, forward=1.0)) == [PadRequest.RELEASE]


def test_after_a_refusal_the_button_is_needed_anew() -> None:
    """While it stays down nothing more is asked."""
    driver = Driver()
    held = reading(Button.ENABLE, forward=1.0)
    driver.looks(reading(), held)
    driver.pad = disable_pad(driver.pad)
    assert driver.looks(held, held) == []


@pytest.mark.parametrize(
    ("raw", "out"),
    [(0.0, 0.0), (0.2, 0.0), (-0.2, 0.0), (0.6, 0.5), (-0.6, -0.5), (1.0, 1.0), (-1.0, -1.0), (1.5, 1.0)],
)
def test_the_dead_zone(raw: float, out: float) -> None:
    """With a zone of 0.2, 0.6 is half of the way that is left: (0.6 - 0.2) / 0.8."""
    assert deflection(raw, 0.2) == pytest.approx(out)


READINGS = st.one_of(
    st.none(),
    st.builds(
        PadReading, st.floats(-1, 1), st.floats(-1, 1), st.frozensets(st.sampled_from(Button), max_size=4)
    ),
)


@settings(max_examples=examples(100))
@given(st.lists(READINGS, max_size=30))
def test_no_motion_is_asked_for_without_the_button(looks: list[PadReading | None]) -> None:
    """Whatever the driver does: a velocity is asked for only while the button is down, and never above turbo's."""
    driver = Driver()
    for look in looks:
        for order in driver.looks(look):
            if isinstance(order, Twist2D):
                assert look is not None
                assert Button.ENABLE in look.down
                assert abs(order.linear_m_s) <= 0.4
                assert abs(order.angular_rad_s) <= 1.6
