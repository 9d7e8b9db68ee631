"""Which of the duties that were offered a board's echo names."""

from chefbotd.core.record import replace
from chefbotd.motion.drive_state import DriveState
from chefbotd.motion.held import obey_duty, offer_duty

WRITES = 105
"""In two cycles of a board that waits for an echo, 1.05 s each, with a command every 20 ms."""


def test_an_echo_after_a_silent_second_names_a_command_of_two_cycles_ago() -> None:
    """A ramp goes on while the board is silent: its echo names the first of 105 duties, and that setpoint is held."""
    state = DriveState(pids=(), duty=(0, 0), held_m_s=(0.3, 0.3), cycle_s=1.05)
    for number in range(WRITES):
        speed_m_s = 0.2 - number / 1000
        duty = (200 - number, 200 - number)
        state = offer_duty(replace(state, duty=duty, setpoint_m_s=(speed_m_s, speed_m_s)))
    assert obey_duty(state, (200.0, 200.0)).held_m_s == (0.2, 0.2)
