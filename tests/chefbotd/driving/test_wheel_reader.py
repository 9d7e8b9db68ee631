"""What is said of a refused reading."""

import pytest
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from chefbotd.core.events import EncodersCounted
from chefbotd.driving.wheel_reader import WheelReader
from chefbotd.settings import load


@pytest.mark.parametrize("has_time", [True, False])
def test_a_jump_on_a_board_without_its_time_says_so(*, has_time: bool) -> None:
    """Without ``t`` a reading has the computer's time, and a burst looks like a jump: the log says what to send."""
    settings = load()
    reader = WheelReader(settings.chassis, settings.encoders, settings.same_side)
    offset_s = 500.0 if has_time else 0.0

    async def read() -> None:
        for step, counts in enumerate((0, 0, 40_000, 90_000, 3)):
            stamp_s = 1000.0 + 0.02 * step
            reader.read(EncodersCounted(stamp_s, stamp_s, stamp_s - offset_s, (counts, counts)), (0.0, 0.0))

    with capture_logs() as logged:
        run_virtual(read())
    jumps = [entry for entry in logged if entry["event"] == "impossible encoder jump refused"]
    assert jumps
    assert all(("sends no 't' line" in entry.get("hint", "")) is not has_time for entry in jumps)
