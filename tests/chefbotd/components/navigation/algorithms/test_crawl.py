"""Driving for a board that is silent for a second in every cycle: by hand."""

import math

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.crawl import Crawl, move_pose, slow_for_silence, watch_silence
from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.navigator import Navigator
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import replace
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

SILENT_S = 0.4
AHEAD = Twist2D(0.04, 0.0)


def after(*readings_s: float, until_s: float) -> Crawl:
    """What is known at the end, with readings at these times and a step every 50 ms."""
    crawl = Crawl()
    for k in range(round(until_s / 0.05) + 1):
        now_s = 0.05 * k
        read_s = max(each for each in readings_s if each <= now_s)
        crawl = watch_silence(crawl, read_s, now_s, SILENT_S, AHEAD)
    return crawl


def test_one_silence_of_a_second_is_no_reason_to_crawl() -> None:
    """Readings every 50 ms, one silence from 1 s to 2 s, and readings again."""
    usual = [0.05 * k for k in range(21)] + [2.0 + 0.05 * k for k in range(21)]
    assert not after(*usual, until_s=3.0).is_on


def test_a_second_silence_at_once_is() -> None:
    """Readings at 1.05 s and 2.1 s alone: from 1.05 + 0.4 s on it is on, and off a second after it is over."""
    assert not after(0.0, 1.05, until_s=1.40).is_on
    assert after(0.0, 1.05, until_s=1.50).is_on
    assert after(0.0, 1.05, 2.1, until_s=3.0).is_on
    again = [3.15 + 0.05 * k for k in range(40)]
    assert after(0.0, 1.05, 2.1, *again, until_s=4.0).is_on
    assert not after(0.0, 1.05, 2.1, *again, until_s=4.3).is_on


def test_each_reading_is_decided_by_once_when_its_scans_have_come() -> None:
    """0.1 s after it, and not again before the next."""
    crawl = Crawl(is_on=True)
    assert not crawl.is_due(10.0, 10.05)
    assert crawl.is_due(10.0, 10.11)
    crawl = crawl.then(10.0, AHEAD)
    assert not crawl.is_due(10.0, 10.8)
    assert crawl.is_due(11.05, 11.2)


def test_the_next_motion_begins_where_the_two_before_it_end() -> None:
    """0.04 m/s for the 1.0 s that the present wait takes, from (1, 2) looking up."""
    crawl = Crawl(is_on=True).then(10.0, AHEAD).then(11.05, Twist2D(0.0, 0.1))
    there = crawl.predicted(Pose2D(1.0, 2.0, math.pi / 2))
    assert (there.x_m, there.y_m) == (pytest.approx(1.0), pytest.approx(2.04))
    assert move_pose(there, crawl.asked[0], 1.05).heading_rad == pytest.approx(math.pi / 2 + 0.105)
    assert not crawl.rests
    standing = Twist2D()
    assert crawl.then(12.1, standing).then(13.15, standing).rests


@pytest.mark.parametrize("rim_m_s", [0.03, 0.06, 0.1])
def test_it_crawls_as_fast_as_the_gate_lets_a_rim_go(rim_m_s: float) -> None:
    """Two thirds of it ahead; in a curve or on the spot, wheels 0.3 m apart, no rim is asked for more."""
    follower = slow_for_silence(replace(ROUND, silent_speed_m_s=rim_m_s)).follower
    assert follower.max_speed_m_s == pytest.approx(2 / 3 * rim_m_s)
    assert follower.max_speed_m_s + 0.15 * follower.curve_turn_rad_s <= rim_m_s
    assert 0.15 * follower.max_turn_rad_s <= rim_m_s
    assert follower.least_speed_m_s <= follower.max_speed_m_s
    assert follower.least_turn_rad_s <= follower.max_turn_rad_s


@pytest.mark.parametrize(("rim_m_s", "crawls"), [(0.06, True), (0.0, False)])
def test_where_the_gate_lets_nothing_move_it_does_not_crawl(rim_m_s: float, crawls: bool) -> None:
    """The same readings, one each 1.05 s, with 0.06 m/s allowed and with nothing."""
    navigator = Navigator(replace(ROUND, silent_speed_m_s=rim_m_s))
    for k in range(63):
        now_s = 0.05 * k
        navigator.step(now_s, Pose2D(), pose_age_s=now_s % 1.05)
    assert navigator.crawls is crawls


def test_seconds_without_a_scan_are_seconds_while_it_crawls() -> None:
    """A board that is silent for 0.45 of each 0.5 s: the last scan is of 4 s, and the goal ends 2.1 s and 10 s later."""
    navigator, pose, ended_s = Navigator(ROUND), Pose2D(2.0, 2.0, 0.1), 0.0
    navigator.use_map(rasterised(box(0, 0, 6.0, 4.0), 6.0, 4.0))
    for k in range(400):
        now_s = 0.05 * k
        if now_s <= 4.0:
            navigator.take_scan(Seen(now_s, pose, np.zeros(2), np.array([[3.0, -0.5], [3.0, 0.5]])))
        if k == 20:
            navigator.navigate_to((Goal(4.5, 2.2, 0.0),))
        step = navigator.step(now_s, pose, pose_age_s=now_s % 0.5)
        if step.ended:
            ended_s = now_s
            assert step.ended[0].reason == "fault: no scan arrived for 10 s"
            break
    assert navigator.crawls
    assert 15.5 < ended_s < 16.7  # to a cycle
