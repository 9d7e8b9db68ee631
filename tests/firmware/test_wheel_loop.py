"""The wheel loop on the board: `w` in mrad/s, its gains by `g`, speeds by the times of edges."""

import math
from collections.abc import Sequence

import pytest

from tests.firmware import host, load, tools

COUNTS, KP, KI, FEEDFORWARD, STATIC, ACCELERATION, CURRENT, BATTERY = range(8)
DEFAULTS = {COUNTS: 1000, KP: 0, KI: 0, FEEDFORWARD: 0, STATIC: 0}


@pytest.fixture
def checked(board: host.Board) -> host.Board:
    """A board in the checked mode with a dead-man of 2 s."""
    board.hello(2000)
    return board


def set_up(board: host.Board, gains: dict[int, int]) -> None:
    """Set these and the defaults of the others."""
    for parameter, value in {**DEFAULTS, **gains}.items():
        board.seal(f"g {parameter} {value}")


def turn(board: host.Board, periods_us: Sequence[int], seconds: float) -> None:
    """Turn both wheels with an edge each so many microseconds (a multiple of 100; negative: backwards; 0: not)."""
    for step in range(1, round(seconds * 10_000) + 1):
        board.run_us(100)
        for wheel, period_us in enumerate(periods_us):
            if period_us and step * 100 % abs(period_us) == 0:
                board.edges(wheel, 1 if period_us > 0 else -1)


def test_it_is_refused_before_it_is_set_up(checked: host.Board) -> None:
    """With 5, as long as one of the parameters 0 to 4 is missing; the answer of `g` is what was set."""
    for parameter in (STATIC, KI, COUNTS, FEEDFORWARD, KP):
        checked.forget()
        refused = checked.seal("w 1000 1000")
        checked.seal(f"g {parameter} 100")
        assert checked.bodies() == [["refused", "5", str(refused)], ["g", str(parameter), "100"]]
    checked.forget()
    checked.seal("w 1000 1000")
    checked.run(0.01)
    assert checked.bodies("state") == [["state", "2", "0", "0", "1"]]


def test_feedforward_and_friction(checked: host.Board) -> None:
    """10 duty per rad/s and 5 of friction: 3 rad/s are 35, -2 rad/s are -25."""
    set_up(checked, {FEEDFORWARD: 2560, STATIC: 1280})
    checked.seal("w 3000 -2000")
    checked.run(0.001)
    assert checked.duty == (35, -25)


def test_a_wheel_that_is_to_stand_gets_no_duty(checked: host.Board) -> None:
    """It brakes, whatever its error; friction has no sign then."""
    set_up(checked, {KP: 2560, STATIC: 1280})
    turn(checked, (1000, -1000), 0.02)
    checked.seal("w 0 0")
    turn(checked, (1000, -1000), 0.02)
    assert checked.duty == (0, 0)


def test_the_proportional_part(checked: host.Board) -> None:
    """5 duty per rad/s: 2 rad/s too slow are 10."""
    set_up(checked, {KP: 1280})
    checked.seal("w 2000 -2000")
    checked.run(0.001)
    assert checked.duty == (10, -10)


@pytest.mark.parametrize("period_us", [200, 500, 1000, 2000, 7000, 50_000])
def test_the_speed_is_that_of_the_edges(checked: host.Board, period_us: int) -> None:
    """Of 1000 counts a turn: with kp alone, the duty is 0 at the edges' speed, and 8 per rad/s beside it."""
    set_up(checked, {KP: 2048})
    speed_mrad_s = round(math.tau / 1000 / (period_us * 1e-6) * 1000)
    turn(checked, (period_us, -period_us), 0.2)
    checked.seal(f"w {speed_mrad_s} {-speed_mrad_s - 1500}")
    turn(checked, (period_us, -period_us), 0.1)
    assert checked.duty == (0, -12)


def test_a_wheel_against_its_command_is_seen_so(checked: host.Board) -> None:
    """Asked for 1 rad/s forward, turning 1 rad/s back: 2 rad/s of error are 10 duty."""
    set_up(checked, {COUNTS: 6283, KP: 1280})
    checked.seal("w 1000 -1000")
    turn(checked, (-1000, 1000), 0.05)
    assert checked.duty == (10, -10)


def test_a_wheel_that_stops_is_seen_without_edges(checked: host.Board) -> None:
    """It cannot be faster than two edges by now: 100 ms after the last one of 1000 it is 0.126 rad/s at most."""
    set_up(checked, {KP: 2560})
    turn(checked, (1000, 1000), 0.1)
    checked.seal("w 6283 6283")
    turn(checked, (1000, 1000), 0.01)
    assert checked.duty == (0, 0)
    checked.run(0.1)
    assert checked.duty == (62, 62)  # (6.283 - 0.126) * 10


def test_the_integral_grows_with_error_and_time(checked: host.Board) -> None:
    """10 duty per rad: an error of 1 rad/s for 1 s is 10; as much the other way takes it back."""
    set_up(checked, {COUNTS: 6283, KI: 2560})
    checked.seal("w 1000 -1000")
    checked.run(1.0)
    assert checked.duty == (10, -10)
    checked.seal("w 1000 -1000")
    turn(checked, (500, -500), 1.0)  # 2 rad/s: 1 rad/s too fast
    assert checked.duty == (0, 0)


def test_the_integral_does_not_wind_up(checked: host.Board) -> None:
    """A wheel that hardly turns for 1.9 s at full duty: as soon as it is too fast, the duty goes down from there."""
    set_up(checked, {COUNTS: 6283, KI: 25_600})
    checked.seal("w 10000 10000")
    turn(checked, (50_000, 50_000), 1.9)
    assert checked.duty == (255, 255)
    checked.seal("w 1000 1000")
    turn(checked, (500, 500), 0.1)  # 1 rad/s too fast for 0.1 s: 10 duty less
    assert 240 <= checked.duty[0] <= 246


def test_the_acceleration_is_limited(checked: host.Board) -> None:
    """2 rad/s2: after half a second 1 rad/s of 3, after 2 s all of it; and as slowly back."""
    set_up(checked, {FEEDFORWARD: 2560, ACCELERATION: 2000})
    checked.seal("w 3000 -3000")
    checked.run(0.5)
    assert checked.duty == (10, -10)
    checked.run(1.4)
    assert checked.duty == (30, -30)
    checked.seal("w 1000 -1000")
    checked.run(0.5)
    assert checked.duty == (20, -20)


def test_it_begins_at_the_speed_that_the_wheels_have(checked: host.Board) -> None:
    """From duty to wheel loop without a brake: 2 rad/s are there, 3 are asked for."""
    set_up(checked, {COUNTS: 6283, FEEDFORWARD: 2560, ACCELERATION: 1000})
    turn(checked, (500, -500), 0.1)
    checked.seal("w 3000 -3000")
    turn(checked, (500, -500), 0.001)
    assert checked.duty == (20, -20)


def test_the_battery_is_compensated(checked: host.Board) -> None:
    """At half the nominal voltage (512/256) twice the duty, full scale at most."""
    set_up(checked, {FEEDFORWARD: 2560, BATTERY: 512})
    checked.seal("w 3000 -20000")
    checked.run(0.001)
    assert checked.duty == (60, -255)


@pytest.mark.parametrize("end", ["s", "plain stop", "estop", "dead-man"])
def test_what_ends_it(checked: host.Board, end: str) -> None:
    """A duty, each kind of stop: the mode is 1 and the loop's duty does not come back by itself."""
    set_up(checked, {FEEDFORWARD: 2560})
    checked.seal("w 3000 3000")
    checked.run(0.01)
    assert checked.duty == (30, 30)
    match end:
        case "s":
            checked.seal("s 7 8")
        case "plain stop":
            checked.write("s 0 0")
        case "estop":
            checked.write("estop")
        case _:
            checked.run(2.0)
    checked.run(0.05)
    assert checked.duty == ((7, 8) if end == "s" else (0, 0))
    assert end == "dead-man" or checked.bodies("state")[-1][1] == "1"


def test_it_feeds_the_dead_man_and_is_told_by_its_number(checked: host.Board) -> None:
    """As `s` does."""
    set_up(checked, {FEEDFORWARD: 2560})
    for _ in range(5):
        number = checked.seal("w 3000 3000")
        checked.run(1.9)
    assert checked.bodies("s")[-1] == ["s", "30", "30", str(number)]


def test_a_wheel_that_stood_for_an_hour_has_no_speed(checked: host.Board) -> None:
    """The clock wraps after 71.6 minutes; the edge of before is no new one."""
    set_up(checked, {KP: 2560})
    turn(checked, (1000, 1000), 0.1)
    for _ in range(47_800):  # 71.7 minutes in large steps, with a cycle in each
        checked.forget()
        checked.fake.micros = (checked.fake.micros + 90_000) % 2**32
        for _ in range(20):
            checked.tick()
        checked.step()
    assert checked.fake.restarts == 0
    checked.hello(2000)
    checked.seal("w 1000 1000")
    checked.run(0.001)
    assert checked.duty == (10, 10)


def test_a_restart_forgets_the_parameters(checked: host.Board) -> None:
    """They are refused as not set up again."""
    set_up(checked, {})
    checked.start(host.PIN)
    checked.hello()
    number = checked.seal("w 1 1")
    assert ["refused", "5", str(number)] in checked.bodies("refused")


def test_a_load_holds_the_boards_loop_back_five_times_less() -> None:
    """A step load: the board's loop at 1 kHz falls behind by a fifth of what the host's at 100 Hz does, at most."""
    tools.need("gcc", "make")
    by_board, by_host = load.fall_behind(load.boards_loop()), load.fall_behind(load.hosts_loop())
    assert by_host.behind_mm >= 5 * by_board.behind_mm
    assert by_host.recovered_ms >= 5 * by_board.recovered_ms
    # In the end, the integral holds the load alone: its torque in duty over ki. It takes a little more on the way.
    duty = load.LOAD_N_M / load.TORQUE_PER_DUTY
    assert by_board.behind_mm == pytest.approx(duty / 1300 * load.RADIUS_M * 1000, rel=0.1)


@pytest.mark.parametrize("offsets", [(0, 200, 4000, 4600), (0, 900, 5500, 6300)])
def test_uneven_edges_make_no_error(checked: host.Board, offsets: tuple[int, ...]) -> None:
    """The phases of a slot are never evenly apart; four counts in 8 ms are 3.1416 rad/s at each millisecond."""
    set_up(checked, {KP: 20_000})  # 78 duty per rad/s: no error of 0.007 rad/s would be missed
    checked.seal("w 3142 3142")
    for step in range(4000):
        checked.run_us(100)
        for _ in range(offsets.count(step * 100 % 8000)):
            checked.edges(0, 1)
            checked.edges(1, 1)
        assert step < 200 or checked.duty == (0, 0), step
