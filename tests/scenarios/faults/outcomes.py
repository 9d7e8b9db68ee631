"""The outcomes that there are, and the times that they are made of.

Every bound on the time to zero is the sum of what must pass before it, which stands beside it, and of some slack:
one cycle of the slowest sketch and its echo, and one period of the driver.
"""

from collections.abc import Mapping

from tests.scenarios.driver import PERIOD_S
from tests.scenarios.fault_run import ENDED, Expected
from tests.scenarios.robots import OBEYED_S

SLACK_S = OBEYED_S + PERIOD_S
AT_ONCE_S = SLACK_S
BOARD_DEAD_MAN_S = 0.26
"""The dead-man of our firmware, a millisecond of its tick, and the time that a line takes."""

RAMP_S = 0.3
"""0.2 m/s at 1 m/s2, and the wheels' last bit of way."""

DEAD_MAN_S = 0.5
STALE_S = 0.25 + SLACK_S
ONCE_A_CYCLE_S = 2.1
"""A board that waits 1 s for its echo reads commands once a cycle, and obeys after that cycle's wait."""

NO_RANGE_SENSOR: Mapping[str, Expected | str] = dict.fromkeys(
    ("tiva_bare", "tiva_second"), "its sketch reads no range sensor"
)
NO_WAIT: Mapping[str, Expected | str] = {
    **NO_RANGE_SENSOR,
    "chefbot": "its firmware does not wait for the echo",
}
NO_BATTERY: Mapping[str, Expected | str] = {"duemilanove": "its sketch does not tell the battery's voltage"}
DRIVES_ON = Expected()
ENDS = Expected(ENDED, None, AT_ONCE_S)
STALE = Expected("armed", "encoders_stale", STALE_S)


def latched(kind: str, within_s: float = AT_ONCE_S, logged: str | None = None) -> Expected:
    """Disarmed by a fault."""
    return Expected("disarmed", kind, within_s, () if logged is None else (logged,))


def estopped(within_s: float = AT_ONCE_S) -> Expected:
    """Somebody pressed it."""
    return Expected("estopped", None, within_s)


def rests(within_s: float) -> Expected:
    """Comes to rest, and nothing latches."""
    return Expected(zero_within_s=within_s)


def drives_on(*logged: str) -> Expected:
    """As if nothing had been, but for the log."""
    return Expected(logged=logged)
