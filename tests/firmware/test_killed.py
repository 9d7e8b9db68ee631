"""Who drives the board is killed, frozen or cut off: real processes, the firmware's images, the boards' own clocks.

``python -m tests.firmware.killed 100`` has the figures of 100 tries.
"""

import os
import signal

import pytest

from tests.firmware.feeder import ran_on_us
from tests.firmware.killed import FAULTS, MOST_S, ran_on_s
from tests.firmware.qemu import Qemu

TIMES = int(os.environ.get("KILLS", "2"))

# Starting a daemon takes seconds, and half a minute on a busy computer.
pytestmark = [pytest.mark.realtime, pytest.mark.slow, pytest.mark.timeout(1800 * TIMES)]


@pytest.mark.parametrize("fault", FAULTS)
def test_the_image_in_simavr_stops_whatever_becomes_of_the_daemon(fault: str) -> None:
    """The daemon drives it in the checked mode; 250 ms after the last byte, and 10 at most, the duty is 0."""
    figures_s = ran_on_s(FAULTS[fault], TIMES)
    assert len(figures_s) == TIMES
    assert max(figures_s) <= MOST_S


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_the_image_in_qemu_stops_when_who_drives_it_ends_or_freezes(number: signal.Signals) -> None:
    """In the middle of a line or after it: to the same limit."""
    board = Qemu()
    try:
        board.wait_for("firmware\t1\t")
        assert all(0 < ran_on_us(board, number) <= MOST_S * 1e6 for _ in range(5 * TIMES))
    finally:
        board.close()
