"""The setpoint that the encoders should show now, if the wheels follow it.

A measured speed is a mean over a window of readings, and the line and the board add to its age. Compared with the
present setpoint, it shows a false error on every ramp, and a controller that acts on it overshoots. So the feedback
compares the measurement with the mean of the setpoint over the same window, equally late. The feedforward needs no
measurement and uses the present setpoint. This is the idea of the Smith predictor ("Closer control of loops with dead
time", Chemical Engineering Progress 53, 1957), with the setpoint as the model: the feedforward makes the wheel follow
it.
"""

from operator import add, sub

from chefbotd.core.record import Record


class Asked(Record, frozen=True):
    """The setpoint of each rim, and for how long it was in force."""

    duration_s: float
    setpoint_m_s: tuple[float, ...]


History = tuple[Asked, ...]
"""Newest last; before the first the wheels stood."""


STEADY_SHARE = 0.1
"""A setpoint that has changed by less, of itself, counts as steady."""


STEADY_S = 10.0
"""No measurement is a mean over so long: how much longer a setpoint has been in force is not counted."""


def remember(history: History, newest: Asked, over_s: float) -> History:
    """The history with the last setpoint, cut to the last ``over_s``; one that stays the same is one entry."""
    if history and history[-1].setpoint_m_s == newest.setpoint_m_s:
        last = history[-1]
        whole = Asked(last.duration_s + newest.duration_s, newest.setpoint_m_s)
        if len(history) == 1:
            return history if last.duration_s >= max(over_s, STEADY_S) else (whole,)
        newest, history = whole, history[:-1]
    first, age_s = len(history), newest.duration_s
    while first and age_s < over_s:
        first -= 1
        age_s += history[first].duration_s
    return (*history[first:], newest)


def midway(before_m_s: tuple[float, ...], after_m_s: tuple[float, ...]) -> tuple[float, ...]:
    """Each rim's mean speed on the way from one speed to another."""
    return tuple([(before + after) / 2 for before, after in zip(before_m_s, after_m_s, strict=True)])


def mean_m_s(history: History, over_s: float, delay_s: float) -> tuple[float, ...]:
    """Each rim's setpoint on the mean over ``over_s`` (> 0), which ended ``delay_s`` ago."""
    if history[-1].duration_s >= delay_s + over_s:
        return history[-1].setpoint_m_s
    way_m = [0.0] * len(history[-1].setpoint_m_s)
    age_s, until_s = 0.0, delay_s + over_s
    for asked in reversed(history):
        begin_s, age_s = age_s, age_s + asked.duration_s
        if age_s > delay_s and begin_s < until_s:
            inside_s = (age_s if age_s < until_s else until_s) - (begin_s if begin_s > delay_s else delay_s)
            for wheel, speed_m_s in enumerate(asked.setpoint_m_s):
                way_m[wheel] += inside_s * speed_m_s
    return tuple([travel_m / over_s for travel_m in way_m])


def caught_up(
    measured_m_s: tuple[float, ...], asked_m_s: tuple[float, ...], setpoint_m_s: tuple[float, ...]
) -> tuple[float, ...]:
    """The present speeds of the rims: the measured ones, plus the change of the setpoints since ``asked_m_s``."""
    return tuple(map(sub, map(add, measured_m_s, setpoint_m_s), asked_m_s))


def is_steady(asked_m_s: tuple[float, ...], setpoint_m_s: tuple[float, ...]) -> bool:
    """Whether what was asked for while the wheels were measured is about what is asked for now, of every rim."""
    if asked_m_s == setpoint_m_s:
        return True
    for asked, setpoint in zip(asked_m_s, setpoint_m_s, strict=True):
        change, most = setpoint - asked, STEADY_SHARE * setpoint
        if change * change > most * most:
            return False
    return True
