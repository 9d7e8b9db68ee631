"""The key and hold logic of teleop, on times written by hand."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.cli.drive.keys import (
    LONGEST_FIRST_HOLD_S,
    MAX_ANGULAR_RAD_S,
    MAX_LINEAR_M_S,
    MOVES,
    SCALES,
    Keys,
    press,
    release_keys,
)
from chefbotd.core.geometry import STANDING, Twist2D
from tests.budget import examples


def pressed(*arrivals: tuple[float, str]) -> Keys:
    """The state after keys that arrived at these times."""
    keys = Keys()
    for at_s, key in arrivals:
        keys = press(keys, key, at_s)
    return keys


def held(key: str, from_s: float, to_s: float, delay_s: float = 0.5) -> list[tuple[float, str]]:
    """What a terminal delivers while a key is down: at once, after the delay, then every 30 ms."""
    repeats = max(0, math.floor((to_s - from_s - delay_s) / 0.03 + 1e-9) + 1)
    return [(from_s, key), *((from_s + delay_s + 0.03 * n, key) for n in range(repeats))]


def test_nothing_is_driven_before_the_first_key() -> None:
    """A keyboard stands before its first key."""
    assert Keys().twist(0.0) == STANDING


@pytest.mark.parametrize(
    ("key", "forward", "turn"),
    [
        ("u", 1, 1), ("i", 1, 0), ("o", 1, -1),
        ("j", 0, 1), ("l", 0, -1),
        ("m", -1, -1), (",", -1, 0), (".", -1, 1),
        ("up", 1, 0), ("down", -1, 0), ("left", 0, 1), ("right", 0, -1),
    ],
)  # fmt: skip
def test_layout(key: str, forward: int, turn: int) -> None:
    """Each key drives the way it lies: up is forward, left is counter-clockwise, as in the classic layout."""
    assert pressed((10.0, key)).twist(10.0) == Twist2D(forward * 0.2, turn * 0.8)


def test_holding_a_key_never_pauses() -> None:
    """A key held for two seconds drives at every instant, over the initial delay too."""
    keys, arrivals = Keys(), held("i", 0.0, 2.0)
    for (at_s, key), (next_s, _) in itertools.pairwise(arrivals):
        keys = press(keys, key, at_s)
        assert keys.twist(at_s) == keys.twist(next_s - 1e-6) == Twist2D(0.2, 0.0)


def test_letting_go_stops_soon() -> None:
    """After a key that repeated, motion ends 0.12 s after its last repeat."""
    arrivals = held("i", 0.0, 1.0)
    last_s = arrivals[-1][0]
    keys = pressed(*arrivals)
    assert keys.twist(last_s + 0.119) == Twist2D(0.2, 0.0)
    assert keys.twist(last_s + 0.121) == STANDING


def test_a_slow_repeat_is_followed() -> None:
    """Repeats 70 ms apart are believed for three of them, 0.21 s."""
    keys = pressed((0.0, "i"), (0.5, "i"), (0.57, "i"))
    assert keys.twist(0.77) != STANDING
    assert keys.twist(0.79) == STANDING


def test_a_tap_lasts_for_the_first_hold() -> None:
    """A single press drives for 0.6 s, because it may be the beginning of a hold."""
    keys = pressed((0.0, "j"))
    assert keys.twist(0.59) == Twist2D(0.0, 0.8)
    assert keys.twist(0.6) == STANDING


@pytest.mark.parametrize(("delay_s", "tap_s"), [(0.25, 0.31), (0.5, 0.56), (0.66, 0.72), (0.79, 0.8)])
def test_the_initial_delay_is_learned(delay_s: float, tap_s: float) -> None:
    """After one held key a tap lasts for that keyboard's delay plus 0.06 s, at most 0.8 s."""
    keys = press(pressed(*held("i", 0.0, 2.0, delay_s)), "l", 5.0)
    assert keys.twist(5.0 + tap_s - 0.01) == Twist2D(0.0, -0.8)
    assert keys.twist(5.0 + tap_s + 0.01) == STANDING


def test_taps_teach_nothing() -> None:
    """Tapping at 0.4 s intervals does not pass for an initial delay."""
    assert pressed((0.0, "i"), (0.4, "i"), (0.8, "i"), (1.2, "i")).first_hold_s == Keys().first_hold_s


def test_a_pause_begins_a_new_press() -> None:
    """The same key after a long pause has a first hold of its own."""
    assert pressed((0.0, "i"), (3.0, "i")).twist(3.59) == Twist2D(0.2, 0.0)


def test_another_key_takes_over_at_once() -> None:
    """The latest motion key is the one that drives."""
    assert pressed((0.0, "i"), (0.1, "j")).twist(0.1) == Twist2D(0.0, 0.8)


@pytest.mark.parametrize("key", ["k", " ", "5", "escape", "I", "q", "z", "x", "e", "c", "A", "W"])
def test_any_other_key_stops(key: str) -> None:
    """Stop keys, and every key without a meaning, end the motion at once."""
    assert pressed((0.0, "i"), (0.1, key)).twist(0.1) == STANDING


def test_release_keeps_the_speeds() -> None:
    """Releasing forgets the key, not the chosen speeds."""
    keys = release_keys(pressed((0.0, "+"), (0.1, "i")))
    assert keys.twist(0.1) == STANDING
    assert press(keys, "i", 0.2).twist(0.2).linear_m_s == pytest.approx(0.22)


@pytest.mark.parametrize(
    ("key", "linear_m_s", "angular_rad_s"),
    [
        ("+", 0.22, 0.88),
        ("-", 0.18, 0.72),
        ("r", 0.22, 0.8),
        ("f", 0.18, 0.8),
        ("y", 0.2, 0.88),
        ("h", 0.2, 0.72),
    ],
)
def test_speed_keys(key: str, linear_m_s: float, angular_rad_s: float) -> None:
    """Keys q and z scale both speeds by 10 %, w and x the forward one, e and c the turning one."""
    keys = pressed((0.0, key))
    assert (keys.linear_m_s, keys.angular_rad_s) == pytest.approx((linear_m_s, angular_rad_s))


def test_a_speed_key_does_not_end_the_motion() -> None:
    """Changing the speed while driving takes effect on the motion under way."""
    assert pressed((0.0, "i"), (0.1, "+")).twist(0.1).linear_m_s == pytest.approx(0.22)


def test_speeds_are_bounded() -> None:
    """However often q is pressed, the speeds stay within the robot's."""
    keys = pressed(*((0.1 * n, "+") for n in range(100)))
    assert (keys.linear_m_s, keys.angular_rad_s) == (MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S)


@settings(max_examples=examples(100))
@given(
    st.lists(
        st.tuples(st.floats(0.001, 1.0), st.sampled_from([*MOVES, *SCALES, "k", "?"])),
        min_size=1,
        max_size=40,
    )
)
def test_motion_always_ends(steps: list[tuple[float, str]]) -> None:
    """Whatever was typed, 0.8 s after the last key the robot stands."""
    now_s, keys = 0.0, Keys()
    for wait_s, key in steps:
        now_s += wait_s
        keys = press(keys, key, now_s)
    assert keys.twist(now_s + LONGEST_FIRST_HOLD_S) == STANDING


@pytest.mark.parametrize(
    ("key", "forward", "turn"),
    [("w", 1, 0), ("a", 0, 1), ("s", -1, 0), ("d", 0, -1), ("up", 1, 0), ("right", 0, -1)],
)
def test_the_page_s_keys_drive_alike(key: str, forward: int, turn: int) -> None:
    """W A S D and the arrows mean in the terminal what they mean on the page, so that no habit arms or speeds up."""
    twist = pressed((0.0, key)).twist(0.1)
    assert (twist.linear_m_s, twist.angular_rad_s) == pytest.approx((0.2 * forward, 0.8 * turn))
