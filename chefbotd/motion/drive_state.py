"""What the wheels' controller is told once, and what one of its steps hands to the next."""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.motion import reference
from chefbotd.motion.limits import AT_REST, LimiterState
from chefbotd.motion.pid import PidState


class DriveParameters(Parameters):
    """``max_rim_speed_m_s`` is what a wheel reaches under load: a motion that needs more is slowed as a whole.

    ``max_duty`` is the wire's full scale, at which the bridge is full on: no duty beyond it is ever sent, whatever the
    gains. A scale that is not the board's makes every gain and feedforward wrong in proportion.

    ``response_delay_s`` is by how much the encoders show what the wheels were asked for later than the mean over their
    readings explains: the line both ways, the board's cycle, the motors.

    Wheels behind each other are dragged sideways in a turn: on the spot that takes ``scrub_duty`` of each beyond its
    friction, and in a curve the share of its way over the ground that is sideways, ``scrub_reach_m`` (half the
    wheelbase) from the middle.

    ``longest_step_s`` bounds the time that one step may account for. A wheel whose duty saturates while it lags behind
    slows the twist by ``yield_per_s`` (share of the twist per second), so that the others do not bend the path;
    ``regain_per_s`` gives it back.
    """

    max_rim_speed_m_s: float = Field(default=0.35, gt=0, le=10)
    max_duty: int = Field(default=255, ge=1, le=32_767)
    response_delay_s: float = Field(default=0.05, ge=0, le=0.5)
    scrub_duty: float = Field(default=0.0, ge=0, le=32_767)
    scrub_reach_m: float = Field(default=0.1, gt=0, le=5)
    longest_step_s: float = Field(default=0.1, gt=0, le=1)
    yield_per_s: float = Field(default=2.0, ge=0, le=100)
    regain_per_s: float = Field(default=0.5, gt=0, le=100)


class DriveState(Record, frozen=True):
    """Everything that one step hands to the next; ``stepped_s`` is None until the first.

    ``loose``: the wheels of a side are not set to the same speed, so that ``limiter`` does not say it all.
    """

    pids: tuple[PidState, ...]
    duty: tuple[int, ...]
    limiter: LimiterState = AT_REST
    stepped_s: float | None = None
    share: float = 1.0
    setpoint_m_s: tuple[float, ...] = ()
    acceleration_m_s2: tuple[float, ...] = ()
    loose: bool = False
    asked: reference.History = ()
