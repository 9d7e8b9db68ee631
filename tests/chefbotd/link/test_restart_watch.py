"""Restarts that only the counters and `Reset Done` tell of."""

import pytest

from chefbotd.link.restart_watch import RestartWatch

STEP_S = 0.0035


def driven(watch: RestartWatch, start: tuple[int, int], per_line: tuple[int, int], lines: int) -> float:
    """Lines of a board without a clock that drives evenly; when the last of them came."""
    for number in range(lines):
        counts = (start[0] + per_line[0] * number, start[1] + per_line[1] * number)
        assert watch.observe(number * STEP_S, counts, has_clock=False) is None
    return (lines - 1) * STEP_S


def test_counters_near_zero_after_a_silence_are_a_restart():
    """0.65 m on (9,656 counts), a second of silence, and both counters near zero: it restarted, and told nobody."""
    watch = RestartWatch()
    last_s = driven(watch, (9656, 9141), (0, 0), 50)
    cause = watch.observe(last_s + 1.2, (7, -3), has_clock=False)
    assert cause == "its counters were near zero, (7, -3), after 1.2 s of silence"
    assert watch.observe(last_s + 1.21, (8, -3), has_clock=False) is None


def test_wheels_that_still_roll_out_do_not_hide_a_restart():
    """2,600 and 2,971 counts/s (0.2 m/s on the right), then a second and a half of silence in which it lost its power.

    Until its sketch braked it rolled 90 and 141 counts on, which is farther from zero than a robot at rest counts.
    """
    watch = RestartWatch()
    last_s = driven(watch, (4986, 4920), (9, 10), 50)
    assert watch.observe(last_s + 1.5, (90, 141), has_clock=False) is not None


@pytest.mark.parametrize("after", [(90, -141), (90, 1500), (-240, 141)])
def test_counters_that_no_wheel_can_have_rolled_to_are_no_restart(after: tuple[int, int]):
    """Beside zero by more than an encoder's play against the wheel's direction, or by more than 0.3 s of rolling."""
    watch = RestartWatch()
    last_s = driven(watch, (4986, 4920), (9, 10), 50)
    assert watch.observe(last_s + 1.5, after, has_clock=False) is None


@pytest.mark.parametrize("before", [(0, 0), (480, -310), (-7, 3)])
@pytest.mark.parametrize("after", [(0, 0), (55, -90), (2, 1)])
def test_a_robot_that_is_near_zero_counts_has_not_restarted(before: tuple[int, int], after: tuple[int, int]):
    """It stood within 3 cm of where its counters began, and after a silence is there still: that is its own doing."""
    watch = RestartWatch()
    last_s = driven(watch, before, (0, 0), 50)
    assert watch.observe(last_s + 1.0, after, has_clock=False) is None


def test_a_robot_that_drives_back_through_zero_has_not_restarted():
    """Backwards at 1,000 and 1,400 counts a second, silent for 0.6 s short of zero: it rolled there."""
    watch = RestartWatch()
    last_s = driven(watch, (745, 1030), (-4, -5), 50)  # ends at 549 and 785, at -1143 and -1429 counts/s
    assert watch.observe(last_s + 0.6, (-40, 60), has_clock=False) is None


def test_a_robot_that_drives_away_from_zero_has_restarted():
    """The same counters, driven forwards before the silence: no wheel rolled back to zero by itself."""
    watch = RestartWatch()
    last_s = driven(watch, (353, 540), (4, 5), 50)
    assert watch.observe(last_s + 0.6, (-40, 60), has_clock=False) is not None


def test_one_wheel_near_zero_is_no_restart():
    """A turn about the left wheel: its counter stays near zero, the right one's does not."""
    watch = RestartWatch()
    last_s = driven(watch, (3, 5000), (0, 0), 50)
    assert watch.observe(last_s + 1.0, (3, 5100), has_clock=False) is None


def test_counters_that_go_on_after_a_silence_have_not_restarted():
    """A second without lines and 210 counts farther on: travel."""
    watch = RestartWatch()
    last_s = driven(watch, (9000, 9000), (4, 4), 50)
    assert watch.observe(last_s + 1.0, (9406, 9390), has_clock=False) is None


def test_reset_done_and_silence_are_a_restart_wherever_the_counters_stand():
    """The sketch without a banner: `Reset Done`, a second of silence, counters at zero as they were nearly before."""
    watch = RestartWatch()
    last_s = driven(watch, (12, -9), (0, 0), 50)
    watch.reset_done(last_s)
    assert watch.observe(last_s + 1.1, (0, 0), has_clock=False) == "it said 'Reset Done' and fell silent"
    assert not watch.has_gone_on


@pytest.mark.parametrize("has_clock", [False, True])
def test_reset_done_without_a_restart_is_told(has_clock: bool):
    """The Arduino sketch says `Reset Done` and goes on: after three more lines it has not restarted."""
    watch = RestartWatch()
    last_s = driven(watch, (4000, 3000), (1, 2), 50)
    watch.reset_done(last_s)
    for number in range(1, 4):
        assert not watch.has_gone_on
        assert watch.observe(last_s + 0.02 * number, (4050, 3100), has_clock=has_clock) is None
    assert watch.has_gone_on


def test_a_board_with_a_clock_restarts_by_its_clock():
    """Its counters near zero after a silence are for the clock to judge, which is surer."""
    watch = RestartWatch()
    last_s = driven(watch, (9656, 9141), (0, 0), 50)
    assert watch.observe(last_s + 1.2, (0, 0), has_clock=True) is None


@pytest.mark.parametrize(
    ("after", "restarted"),
    [((-100, 190), True), ((-101, 190), False), ((185, 271), True), ((185, 272), False), ((186, -99), False)],
)
def test_how_far_a_wheel_rolls_out_and_dithers(after: tuple[int, int], restarted: bool):
    """At 285.7 and 571.4 counts/s they are 0 to 85.7 and 171.4 counts on after 0.3 s, give or take 100."""
    watch = RestartWatch()
    last_s = driven(watch, (5000, 4000), (1, 2), 50)
    assert (watch.observe(last_s + 1.5, after, has_clock=False) is not None) is restarted


@pytest.mark.parametrize(("after", "restarted"), [((2, -2), True), ((3, 3), False), ((-120, 2), False)])
def test_counters_at_zero_are_a_restart_even_where_the_wheels_could_have_rolled(
    after: tuple[int, int], restarted: bool
):
    """Backwards at 1,143 and 1,429 counts/s, 0.6 s short of zero; by chance no two wheels are within 2 counts of it."""
    watch = RestartWatch()
    last_s = driven(watch, (745, 1030), (-4, -5), 50)
    assert (watch.observe(last_s + 0.6, after, has_clock=False) is not None) is restarted


@pytest.mark.parametrize(("silent_s", "restarted"), [(0.6, False), (0.3, True)])
def test_one_wheel_that_cannot_have_rolled_to_zero_is_enough(silent_s: float, restarted: bool):
    """549 counts at -1,143 a second take 0.48 s, less 100 of play; the right wheel is fast enough in 0.3 s."""
    watch = RestartWatch()
    last_s = driven(watch, (745, 1600), (-4, -20), 50)
    assert (watch.observe(last_s + silent_s, (-40, -60), has_clock=False) is not None) is restarted


def test_a_restart_is_told_once():
    """The second line after it is held against the first: a second of silence in which it stayed at zero is no other."""
    watch = RestartWatch()
    last_s = driven(watch, (9656, 9141), (0, 0), 50)
    assert watch.observe(last_s + 1.2, (7, -3), has_clock=False) is not None
    assert watch.observe(last_s + 2.4, (7, -3), has_clock=False) is None


def test_reset_done_is_over_with_the_restart():
    """After the restart that it announced, a silence at any counts is only a silence."""
    watch = RestartWatch()
    last_s = driven(watch, (12, -9), (0, 0), 50)
    watch.reset_done(last_s)
    assert watch.observe(last_s + 1.1, (0, 0), has_clock=False) is not None
    assert watch.observe(last_s + 2.2, (40, 90), has_clock=False) is None


def test_lines_after_a_restart_do_not_tell_that_the_board_went_on():
    """`Reset Done`, a second of silence, and then as many lines as would show that it had not restarted."""
    watch = RestartWatch()
    last_s = driven(watch, (12, -9), (0, 0), 50)
    watch.reset_done(last_s)
    assert watch.observe(last_s + 1.1, (0, 0), has_clock=False) is not None
    for number in range(1, 6):
        assert watch.observe(last_s + 1.1 + 0.02 * number, (number, 0), has_clock=False) is None
        assert not watch.has_gone_on


@pytest.mark.parametrize(("after", "restarted"), [((174, 249), True), ((176, 249), False)])
def test_the_rate_is_taken_from_read_to_read(after: tuple[int, int], restarted: bool):
    """Four lines a read, 16 ms apart, are 250 and 500 counts/s: 75 and 150 counts of rolling out, and 100 of play."""
    watch = RestartWatch()
    for number in range(80):
        counts = (5000 + number, 4000 + 2 * number)
        assert watch.observe(number // 4 * 0.016, counts, has_clock=False) is None
    assert (watch.observe(19 * 0.016 + 1.5, after, has_clock=False) is not None) is restarted
