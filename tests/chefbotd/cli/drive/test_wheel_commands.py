"""``chefbotctl wheels``, and driving under a name with ``--take-over``."""

import json
import socket

import pytest

from chefbotd.cli.common.exits import Exit
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control

ENDED = ["drive", "release_control"]
"""Its own motion is ended by a velocity of zero, and its source is given back."""


def test_wheels_are_turned_at_20_hz_and_end_at_zero(control: Control, daemon: FakeDaemon) -> None:
    """A second of it is 20 commands and zero; what the wheels did before it is told (the fake's: +1 and -2)."""
    result = control("--json", "wheels", "left_wheel=1", "right_wheel=-2.5", "--for", "1")
    asked = [given for _, name, given in daemon.calls if name == "set_wheel_velocities"]
    assert len(asked) == pytest.approx(20, abs=1)
    assert asked[0] == {"name": ["left_wheel", "right_wheel"], "velocity_rad_s": [1.0, -2.5]}
    assert daemon.methods() == ["set_client_name", "get_pid", "set_wheel_velocities", "get_state", *ENDED]
    assert result.exit_code == 0
    assert json.loads(result.stdout) == {
        "velocity_rad_s": {"left_wheel": 1.0, "right_wheel": -2.0},
        "happened": True,
        "allowed_rad_s": {"left_wheel": 1.0, "right_wheel": -2.5},
        "limited_by": None,
        "held_by": None,
    }


def test_a_wheel_that_does_not_turn_is_told(control: Control) -> None:
    """Exit code 6, and the wheel is named: it did less than a tenth of what it was told."""
    result = control("wheels", "left_wheel=30", "right_wheel=-2", "--for", "0.1")
    assert result.exit_code == Exit.NOT_DONE
    assert "left_wheel +1.00 rad/s, right_wheel -2.00 rad/s" in result.stdout
    assert "Limited" not in result.stdout
    assert result.stderr.startswith("Error: ")
    assert "left_wheel" in result.stderr
    assert "right_wheel" not in result.stderr


def test_wheels_are_judged_by_what_was_allowed(control: Control) -> None:
    """Of 1000 and -500 rad/s the fake allows 50 and -25; turning at 1 and -2 the left one did next to nothing of it."""
    result = control("wheels", "left_wheel=1000", "right_wheel=-500", "--for", "0.1")
    assert result.exit_code == Exit.NOT_DONE
    assert result.stdout.splitlines() == [
        "Limited by limits.linear to left_wheel +50.00 rad/s, right_wheel -25.00 rad/s.",
        "Turned at the end: left_wheel +1.00 rad/s, right_wheel -2.00 rad/s",
    ]
    assert result.stderr.endswith("hardly turned: left_wheel, right_wheel\n")


def test_a_clipped_request_is_no_failure(control: Control) -> None:
    """Of 150 and -5000 rad/s it allows 1.5 and -50; the left wheel, turning at 1, did a good part of that."""
    result = control("--json", "wheels", "left_wheel=150", "right_wheel=-5000", "--for", "0.1")
    answer = json.loads(result.stdout)
    assert answer["allowed_rad_s"] == {"left_wheel": 1.5, "right_wheel": -50.0}
    assert (answer["limited_by"], answer["held_by"]) == ("limits.linear", None)
    assert json.loads(result.stderr)["error"]["message"].endswith("hardly turned: right_wheel")


def test_what_holds_the_wheels_up_is_told(control: Control, daemon: FakeDaemon) -> None:
    """An obstacle is no broken wheel: the error says so."""
    daemon.held_by = "obstacle:front"
    result = control("wheels", "left_wheel=30", "--for", "0.1")
    assert result.stderr.endswith("hardly turned: left_wheel; slowed by obstacle:front\n")


def test_refused_wheels_are_given_back_all_the_same(control: Control, daemon: FakeDaemon) -> None:
    """A wheel that is not there is the robot's refusal; zero is commanded on this way out as well."""
    daemon.refuse["set_wheel_velocities"] = "unknown_wheel"
    result = control("wheels", "middle=1", "--for", "1")
    assert result.exit_code == Exit.REFUSED
    assert "unknown_wheel" in result.stderr
    assert daemon.methods() == ["set_client_name", "get_pid", "set_wheel_velocities", *ENDED]


@pytest.mark.parametrize(
    ("wheels", "told"),
    [
        (["left"], "'left' is not NAME=RAD_S"),
        (["=1"], "'=1' is not NAME=RAD_S"),
        (["left=fast"], "'fast' is not a number"),
        (["left=inf"], "'inf' is not finite"),
        (["left=1", "left=2"], "named once"),
        ([], "Missing argument"),
    ],
)
def test_what_is_no_wheel_and_speed_is_a_usage_error(
    control: Control, daemon: FakeDaemon, wheels: list[str], told: str
) -> None:
    """It is refused before anything is asked of the robot."""
    result = control("wheels", *wheels, "--for", "1")
    assert (result.exit_code, daemon.calls) == (2, [])
    assert told in result.stderr


@pytest.mark.parametrize("args", [["drive", "0.1", "0"], ["wheels", "left=1"]])
def test_taking_over_comes_before_driving(control: Control, daemon: FakeDaemon, args: list[str]) -> None:
    """The program says its name, takes control of the default source, and only then drives."""
    assert control(*args, "--for", "0.1", "--take-over").exit_code in (0, Exit.NOT_DONE)
    (_, _, introduced), (_, taken, params) = daemon.calls[:2]
    assert introduced == {"client": f"chefbotctl {args[0]} on {socket.gethostname()}"[:64]}
    assert (taken, params) == ("take_control", {})


def test_a_wheel_goes_by_its_short_name_as_well(control: Control, daemon: FakeDaemon) -> None:
    """``left`` is ``left_wheel``, as ``status`` calls it."""
    result = control("wheels", "left=1", "right_wheel=-2.5", "--for", "0.1")
    asked = next(given for _, name, given in daemon.calls if name == "set_wheel_velocities")
    assert asked["name"] == ["left_wheel", "right_wheel"]
    assert "left_wheel +1.00 rad/s, right_wheel -2.00 rad/s" in result.stdout


def test_a_wheel_that_is_named_by_both_its_names(control: Control, daemon: FakeDaemon) -> None:
    """It is named twice, and nothing moves."""
    twice = control("wheels", "left=1", "left_wheel=2", "--for", "0.1")
    assert (twice.exit_code, "left_wheel is left_wheel too" in " ".join(twice.stderr.split())) == (
        Exit.USAGE,
        True,
    )
    assert "set_wheel_velocities" not in daemon.methods()
