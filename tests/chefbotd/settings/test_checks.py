"""What the sections of a configuration ask of each other."""

from pathlib import Path

import pytest

from chefbotd.settings import SettingsError, load, packaged
from firmware_protocol.codec import VARIANTS, Variant
from firmware_protocol.messages import Orientation, RawImu, UltrasonicDistance
from tests.chefbotd.settings.robot_file import spoil


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ({"robot.wire": "morse"}, "robot.wire: .*should be one of classic, four_wheels, khan, khan_edges"),
        ({"robot.wire": "classic"}, "the wire 'classic' has 2 wheels, the chassis names 4"),
        ({"ultrasonic": {"name": "front"}}, "range sensors need names of their own, there are front"),
        (
            {"infrared": [{"name": "a", "setback_m": 0.1}, {"name": "b", "setback_m": 0.1}]},
            r"need analogue inputs of their own, got channels \[0, 0\]",
        ),
        (
            {"robot.wire": "four_wheels"},
            r"\[\[infrared\]\] front needs a line that the wire 'four_wheels' does not have; "
            "those with one: khan, khan_edges$",
        ),
        (
            {"quadrature.window_s": 0.1},
            r"\[quadrature\] needs a line that the wire 'khan' does not have; those with one: khan_edges$",
        ),
        (
            {"infrared": [], "safety.guard.silent_is_obstacle": True},
            r"\[safety.guard\] has no sensor to guard with: configure \[ultrasonic\], \[\[infrared\]\] or \[\[lidar\]\]",
        ),
        (
            {"infrared.0.setback_m": 0.2},
            r"infrared front sits 0.2 m behind .* would touch before the guard stops it 0.2 m from the sensor",
        ),
    ],
)
def test_parts_that_do_not_go_together_are_refused(overrides: dict[str, object], told: str):
    """A wire that is not this robot's, sensors that could not be told apart, and sections that nothing would feed."""
    with pytest.raises(SettingsError, match=told):
        load(packaged("khan"), overrides=overrides)


@pytest.mark.parametrize(
    ("section", "excluded"), [("ultrasonic", (UltrasonicDistance,)), ("imu", (Orientation, RawImu))]
)
def test_a_sensor_whose_line_the_board_leaves_out_is_refused(
    monkeypatch: pytest.MonkeyPatch, section: str, excluded: tuple[type, ...]
):
    """A board of one's own without the line: the section is named, and the wires that have it."""
    monkeypatch.setitem(VARIANTS, "mute", Variant("mute", excluded=excluded))
    with pytest.raises(
        SettingsError, match=rf"\[{section}\] needs a line that the wire 'mute' does not have; .*: classic,"
    ):
        load(overrides={"robot.wire": "mute"})


def test_all_that_does_not_go_together_is_told_at_once():
    """In one line, without the whole configuration after it."""
    with pytest.raises(SettingsError) as error:
        load(packaged("khan"), overrides={"robot.wire": "classic"})
    path = packaged("khan")
    assert str(error.value) == (
        f"{path}: the wire 'classic' has 2 wheels, the chassis names 4; [[infrared]] front needs a line that the wire "
        "'classic' does not have; those with one: khan, khan_edges"
    )


EDGES = {"robot.wire": "khan_edges"}


@pytest.mark.parametrize(
    "fits", [{}, {"link.baud": 57_600, "drive.max_rim_speed_m_s": 0.15}, {"quadrature.window_s": 0.1}]
)
def test_edges_that_fit_their_line_are_accepted(fits: dict[str, object]):
    """KHAN's 898 counts a turn need 11,320 of 11,520 bytes/s at 1.1 m/s; at half the baud rate, 0.15 m/s still do."""
    assert load(packaged("khan"), overrides={**EDGES, **fits}).robot.wire == "khan_edges"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            {"link.baud": 57_600},
            "898 .* 36.7 rad/s .*max_rim_speed_m_s 1.1.* need 11320 bytes/s, .*57600 carries 5760",
        ),
        (
            {"encoders.counts_per_turn": 4200},
            "4200 encoders.counts_per_turn .* need .* bytes/s, .*115200 carries 11520",
        ),
        ({"drive.max_rim_speed_m_s": 1.3}, "at 43.3 rad/s"),
        ({"chassis.left_radius_multiplier": 0.9}, "at 40.7 rad/s"),
    ],
)
def test_edges_that_do_not_fit_their_line_are_refused(more: dict[str, object], told: str):
    """A slower line, finer encoders, faster or smaller wheels: counts, speed, and bytes needed and there are named."""
    with pytest.raises(
        SettingsError, match=f"the wire 'khan_edges' cannot carry every edge: 4 wheels of .*{told}"
    ):
        load(packaged("khan"), overrides={**EDGES, **more})


def test_a_wheel_that_would_be_taken_for_all_of_them_is_refused(chefbot: Path):
    """``set_pid`` calls every wheel 'all', so none can have that name."""
    with pytest.raises(SettingsError, match="no wheel can be named 'all'"):
        load(spoil(chefbot, 'name = "left_wheel"', 'name = "all"'))


def test_gains_beyond_the_duty_range_are_refused(chefbot: Path):
    """An output limit above drive.max_duty: both numbers and the wheel are named."""
    with pytest.raises(
        SettingsError, match=r"output_limit_duty 5000.0 of left_wheel is beyond drive.max_duty 255"
    ):
        load(spoil(chefbot, "output_limit_duty = 255.0", "output_limit_duty = 5000.0"))


def test_a_limit_that_blinds_the_stall_detector_is_refused(chefbot: Path):
    """Duty of 30 at most never reaches 0.12 of 255, from where on a wheel must turn: both are named. 31 does."""
    with pytest.raises(
        SettingsError,
        match=r"output_limit_duty 30.0 of left_wheel never drives it beyond 30.6 .*share 0.12",
    ):
        load(chefbot, overrides={"pid.output_limit_duty": 30.0})
    assert load(chefbot, overrides={"pid.output_limit_duty": 31.0}).pid.output_limit == 31.0


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (
            {"limits.linear.deceleration_m_s2": 0.1},
            "guard.deceleration_m_s2 0.5 counts on more braking than limits.linear.deceleration_m_s2 0.1 allows.* front",
        ),
        (
            {"ultrasonic.mount_heading_rad": 3.0, "limits.linear.reverse_deceleration_m_s2": 0.4},
            "more braking than limits.linear.reverse_deceleration_m_s2 0.4 allows",
        ),
        # Still gaining 1 m/s2 at 0.24 m/s, with 5 m/s3: 0.061 m up to 0.34 m/s, and 0.17 m/s x (0.34 + 0.2) s.
        (
            {"limits.linear.jerk_m_s3": 5.0},
            r"counts on 0.058 m to brake from 0.24 m/s .*deceleration_m_s2 1 with jerk_m_s3 5 takes 0.153 m",
        ),
        # At 1.2 rad a beam shortens by 0.36 of the way: 0.36 x (0.116 - 0.042) m would be missing.
        (
            {"ultrasonic.mount_heading_rad": 1.2, "limits.linear.deceleration_m_s2": 0.5},
            r"counts on 0.042 m to brake from 0.34 m/s .* takes 0.116 m",
        ),
    ],
    ids=["forward", "reverse", "jerk", "slanting"],
)
def test_a_guard_that_counts_on_more_braking_than_there_is_is_refused(
    overrides: dict[str, object], told: str
):
    """Both numbers are named; without the guard the same limits are fine."""
    with pytest.raises(SettingsError, match=told):
        load(overrides=overrides)
    assert load(overrides={**overrides, "safety.guard.enabled": False}).safety.guard.enabled is False


@pytest.mark.parametrize(
    "overrides",
    [
        {"limits.linear.deceleration_m_s2": 0.5},
        {"limits.linear.jerk_m_s3": 20.0},
        {"limits.linear.deceleration_m_s2": 0.1, "safety.guard.deceleration_m_s2": 0.1},
        {"limits.linear.reverse_deceleration_m_s2": 0.1},
    ],
)
def test_a_guard_that_counts_on_no_more_braking_than_there_is_is_accepted(overrides: dict[str, object]):
    """As much as the limits allow, a jerk that costs millimetres, and a limit that no sensor hangs on."""
    assert load(overrides=overrides).safety.guard.enabled


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ({"battery.low_v": 12.9}, "battery: low_v must be below full_v, got 12.9 and 12.9"),
        ({"limits.linear.max_forward_m_s": 0}, r"limits\.linear\.max_forward_m_s: .*greater than 0"),
    ],
)
def test_values_with_which_no_robot_works(overrides: dict[str, object], told: str):
    """A battery that is low when it is full, a robot that may not drive."""
    with pytest.raises(SettingsError, match=told):
        load(overrides=overrides)
