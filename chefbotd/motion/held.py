"""Which command the board holds: it reads once in a cycle, obeys later, and says in its echo what it obeys.

A feedforward that takes a motor from the speed of one command to that of the next must know which command was read. What
is written between two readings may come too late for a cycle, or be held back on the way.
"""

from collections.abc import Sequence

from chefbotd.core.record import replace
from chefbotd.motion.drive_state import DriveState

UNREAD_S = 0.007
"""What is written so shortly before a reading arrives was not read in that cycle: the lines before it take as long."""

SLOW_CYCLE_S = 0.03
"""From this cycle on a board has its echo out before it reads again, whatever its line and its USB converter."""

MOST_OFFERS = 128
"""So many duties are remembered: more than are written in two of a board's cycles, each a second's wait for an echo and
50 ms, with a command every 20 ms."""

MOST_SUPPLY_SHARE = 1.5
"""A voltage farther from the models' than this factor is an error of its measurement, and makes up for nothing."""

SUPPLY_FILTER_SHARE = 0.1
"""Of the difference that a reading of the battery shows; the rest follows with the next ones."""


def reached_m_s(state: DriveState, now_s: float) -> tuple[float, ...]:
    """The setpoints that the wheels are at when the next command comes into force, as far as time alone tells."""
    if not state.earlier_m_s or state.cycle_s < SLOW_CYCLE_S or state.stepped_s is None:
        return state.setpoint_m_s
    return state.earlier_m_s if now_s - state.stepped_s < UNREAD_S else state.setpoint_m_s


def offer_duty(state: DriveState) -> DriveState:
    """The state's duty goes out."""
    newest = (state.duty, state.setpoint_m_s)
    if state.offered and state.offered[-1] == newest:
        return state
    return replace(state, offered=(*state.offered[1 - MOST_OFFERS :], newest))


def obey_duty(state: DriveState, echoed_duty: Sequence[float]) -> DriveState:
    """The board obeys this duty, whatever it was offered: the models begin from the setpoint of that.

    Only where the echo of a cycle is here before the next one begins; a faster board has read more by then.
    """
    if state.cycle_s < SLOW_CYCLE_S:
        return state
    held_m_s = None if any(echoed_duty) else (0.0,) * len(echoed_duty)
    for duty, setpoint_m_s in state.offered:  # the last one counts
        if duty == echoed_duty:
            held_m_s = setpoint_m_s
    return state if held_m_s in (None, state.held_m_s) else replace(state, held_m_s=held_m_s)


def compensate_voltage(state: DriveState, nominal_v: float | None, voltage_v: float) -> DriveState:
    """The battery has this voltage, and the models that of ``nominal_v``."""
    if nominal_v is None or not voltage_v > 0:
        return state
    share = nominal_v / voltage_v
    if not 1 / MOST_SUPPLY_SHARE <= share <= MOST_SUPPLY_SHARE:
        return state
    return replace(
        state, supply_share=state.supply_share + SUPPLY_FILTER_SHARE * (share - state.supply_share)
    )
