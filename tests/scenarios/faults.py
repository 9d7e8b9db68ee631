"""The table of faults: how each happens to the simulated robot, and the one outcome that it may have.

Every bound on the time to zero is the sum of what must pass before it, which stands beside it, and of some slack:
one board cycle and one period of the driver.
"""

from functools import partial

from tests.scenarios.inject import (
    REPLUG_S,
    abuse,
    broken_encoder,
    cancelled,
    critical_battery,
    damaged,
    deaf_board,
    departure,
    estop,
    failing_service,
    failing_step,
    noise,
    nothing,
    reset,
    silence,
    stop,
    swapped_encoders,
    unheard,
    unplugged,
    wall,
)
from tests.scenarios.trial import ENDED, Expected, Fault
from tests.scenarios.wires import frozen, jumping, reversed_from_now

SLACK_S = 0.1
AT_ONCE_S = SLACK_S
RAMP_S = 0.3
"""0.2 m/s at 1 m/s2, and the wheels' last bit of way."""

LONGEST_BACKOFF_S = 2.0


def latched(kind: str, within_s: float = AT_ONCE_S) -> Expected:
    """Disarmed by a fault."""
    return Expected("disarmed", kind, within_s)


def rests(within_s: float) -> Expected:
    """Comes to rest, and nothing latches."""
    return Expected(zero_within_s=within_s)


DRIVES_ON = Expected()

FAULTS = (
    Fault("driver falls silent", silence, rests(0.5 + RAMP_S + SLACK_S)),
    Fault("driver's connection ends", departure, rests(RAMP_S + SLACK_S)),
    Fault("stop", stop, rests(RAMP_S + SLACK_S)),
    Fault("estop", estop, Expected("estopped", None, AT_ONCE_S)),
    *(
        Fault(
            f"{what}, wheel {wheel}",
            broken_encoder(partial(broken, wheel)),
            latched(kind, within_s),
            on_wire=True,
        )
        for wheel in (0, 1)
        for what, broken, kind, within_s in (
            ("encoder unplugged", frozen, "wheel_stalled", 2.2),
            ("encoder reversed", reversed_from_now, "wheel_reversed", 0.6),
            ("encoder jumps", jumping, "encoder_jumps", 0.5),
        )
    ),
    Fault(
        "encoders swapped", swapped_encoders, latched("wheel_reversed", 1.2), twist=(0.0, 1.0), on_wire=True
    ),
    Fault(
        "battery critical",
        critical_battery,
        latched("battery_critical", 5.0 + SLACK_S),
        lasts_s=7.0,
        on_wire=True,
    ),
    Fault("wall ahead", wall, Expected("armed", "obstacle:front", 3.0), lasts_s=5.0, leave=(-0.2, 0.0)),
    Fault(
        "board silent for 1 s",
        unheard,
        Expected("armed", "encoders_stale", 0.25 + SLACK_S),
        1.0,
        on_wire=True,
    ),
    Fault("board silent for longer", unheard, latched("encoders_silent", 0.25 + SLACK_S), on_wire=True),
    Fault(
        "noise at 1 MB/s for 1 s",
        noise,
        Expected("armed", "encoders_stale", 0.25 + SLACK_S),
        1.0,
        on_wire=True,
    ),
    *(
        Fault(f"1 % of bytes: {share}", partial(damaged, f"{share}_share"), DRIVES_ON, on_wire=True)
        for share in ("flip", "drop", "double")
    ),
    Fault(
        "cable pulled for 1 s",
        unplugged,
        latched("link_lost", REPLUG_S + LONGEST_BACKOFF_S + SLACK_S),
        lasts_s=4.0,
        on_wire=True,
    ),
    Fault("board restarts", reset, latched("board_restarted"), on_wire=True),
    Fault("board reads nothing for 0.5 s", deaf_board, Expected("estopped", None, 0.5 + SLACK_S)),
    Fault("board's clock wraps", nothing, DRIVES_ON, overrides={"sim.board.boot_micros": 2**32 - 3_000_000}),
    Fault("control step fails", failing_step, latched("internal_error")),
    Fault("service raises", partial(failing_service, 1), latched("service_failed")),
    *(
        Fault(f"service cancelled: {service}", partial(cancelled, service), latched("service_failed"))
        for service in ("odometry", "sensors", "stats")
    ),
    Fault("service cannot run", partial(failing_service, 6), Expected(ENDED, None, AT_ONCE_S)),
    *(
        Fault(f"task lost: {task}", partial(cancelled, task), Expected(ENDED, None, AT_ONCE_S))
        for task in ("drive", "link")
    ),
    Fault("twenty clients misbehave", abuse, DRIVES_ON),
)
