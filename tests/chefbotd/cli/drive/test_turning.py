"""Turning in place over a link that shows late what was asked."""

import math

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.turning import Try, TurnInPlace, begin, step
from chefbotd.core.record import replace


class LateRobot:
    """Turns exactly as asked, ``delay_s`` later; odometry comes every ``cycle_s``. Below ``sticks_rad_s`` it stands."""

    def __init__(
        self, remaining_rad: float, delay_s: float, cycle_s: float, sticks_rad_s: float = 0.0
    ) -> None:
        self.remaining_rad, self.now_s, self.cycle_s, self.sticks_rad_s = (
            remaining_rad,
            7.0,
            cycle_s,
            sticks_rad_s,
        )
        self._coming = [0.0] * round(delay_s / 0.005)
        self.rate = 0.0

    def obey(self, rate: float) -> None:
        """For a cycle."""
        for _ in range(round(self.cycle_s / 0.005)):
            self._coming.append(rate)
            asked = self._coming.pop(0)
            self.rate = asked if abs(asked) >= self.sticks_rad_s else 0.0
            self.remaining_rad -= self.rate * 0.005
            self.now_s += 0.005


def turn_it(robot: LateRobot) -> tuple[TurnInPlace, float]:
    """To its end: the turn, and the seconds that it took."""
    began_s, turn = robot.now_s, begin(robot.now_s, robot.remaining_rad)
    while True:
        turn, rate = step(turn, robot.now_s, robot.remaining_rad, stands=robot.rate == 0.0)
        if rate is None:
            return turn, robot.now_s - began_s
        robot.obey(rate)


@pytest.mark.parametrize("degrees", [90.0, -90.0, 170.0, -33.0, 2.0, -0.7])
@pytest.mark.parametrize(("delay_s", "cycle_s"), [(0.05, 0.005), (0.1, 0.02), (0.15, 0.05), (0.35, 0.05)])
def test_it_comes_to_rest_at_its_heading(degrees: float, delay_s: float, cycle_s: float) -> None:
    """Whatever the delay: within half a degree, and within 2 s of the time at 1.2 rad/s and 1 rad/s2 and the delays."""
    robot = LateRobot(math.radians(degrees), delay_s, cycle_s)
    _, took_s = turn_it(robot)
    assert abs(math.degrees(robot.remaining_rad)) <= 0.5
    way_rad = abs(math.radians(degrees))
    ideal_s = way_rad / 1.2 + 0.6 if way_rad > 0.72 else 2 * math.sqrt(way_rad / 2)
    assert took_s <= ideal_s + 2.0


def test_it_learns_the_delay() -> None:
    """It began with 0.2 s where it takes 0.4 s and a cycle: what the next turn begins with is nearer to that."""
    turn, _ = turn_it(LateRobot(1.3, 0.4, 0.05))
    assert turn.tries > 1
    assert 0.3 <= turn.delay_s <= 0.5


def test_a_robot_that_sticks_is_pushed_faster() -> None:
    """Creeping at 0.15 rad/s it does not move: it is tried at 0.21 and then 0.294, which moves it."""
    robot = LateRobot(0.01, 0.1, 0.02, sticks_rad_s=0.25)
    turn, _ = turn_it(robot)
    assert abs(math.degrees(robot.remaining_rad)) <= 0.5
    assert turn.tries >= 3


def test_a_robot_that_does_not_turn_is_given_up() -> None:
    """It says how much is left after how long, and what to look at."""
    robot = LateRobot(0.5, 0.1, 0.02, sticks_rad_s=9.0)
    with pytest.raises(ProgramError, match=r"\+28\.6° left of 29° after .*expected within 0\.5°") as caught:
        turn_it(robot)
    assert caught.value.code is Exit.NOT_DONE
    assert robot.now_s < 7.0 + 0.5 / 1.2 + 1.2 + 15.1


def test_nothing_to_turn_is_done() -> None:
    """A robot that stands within the tolerance is asked for nothing."""
    turn = begin(3.0, -0.006)
    assert step(turn, 3.0, -0.006, stands=True) == (turn, None)


def test_the_last_try_may_miss_by_twice_the_tolerance() -> None:
    """0.9 degrees off (the tolerance is 0.46) ends the twelfth try, not the eleventh; 1.0 is a failure."""
    stopped = Try(direction=1, from_rad=0.03, began_s=6.0, stopped_s=7.0)
    last = TurnInPlace(began_s=0.0, whole_rad=1.5, delay_s=0.2, creep_rad_s=0.15, tries=12, now=stopped)
    assert step(last, 8.0, math.radians(0.9), stands=True)[1] is None
    before, rate = step(replace(last, tries=11), 8.0, math.radians(0.9), stands=True)
    assert (before.tries, rate is None) == (12, False)
    beyond, _ = step(last, 8.0, math.radians(-1.0), stands=True)
    with pytest.raises(ProgramError, match=r"-1\.0° left of 86° after 8 s and 12 tries"):
        step(beyond, 8.02, math.radians(-1.0), stands=True)
