"""Parameters and state of the wheels' controller."""

from collections.abc import Mapping
from typing import Any, ClassVar, Final

from msgspec import field
from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.motion import reference
from chefbotd.motion.limits import AT_REST, LimiterState
from chefbotd.motion.motor_model import WheelMotor
from chefbotd.motion.pid import PidState

LOADED_SHARE = 0.9
"""``max_rim_speed_m_s`` is what a wheel reaches under load; free it is faster by a tenth (0.34 of 0.377 m/s)."""

MAX_STEP_S: Final = 0.1
"""The longest time that one step of the controller accounts for: twice the slowest published sketch's cycle, 50 ms."""

SATURATION_RECOVERY_PER_S: Final = 0.5
"""How fast a twist that was slowed for a saturated wheel is given back, as a share per second; assumed."""


class DriveParameters(Parameters):
    """Limits and delays of the wheels' controller.

    ``max_rim_speed_m_s`` is what a wheel reaches under load: a motion that needs more is slowed as a whole.
    ``max_duty`` is the wire's full scale, at which the bridge is fully on. No larger duty is ever sent, whatever the
    gains. If it is not the full scale of the board, every gain and feedforward is wrong in proportion.

    ``response_delay_s`` is the delay between command and encoder reading that the averaging of the readings does not
    explain: the line in both directions, the board's cycle, the motors.

    A wheel's integral acts in full once all setpoints have been steady for ``integral_settle_s`` in what was measured
    too, and with ``UNSETTLED_SHARE`` of its gain before: so a fast integral does not take the lag of a start for an
    error of the feedforward, and overshoot. 0: it always acts in full.

    In a turn, wheels behind each other are dragged sideways. Turning on the spot takes ``scrub_duty`` of each wheel
    beyond its friction. In a curve it takes the share of that by which the wheel moves sideways over the ground,
    ``scrub_reach_m`` (half the wheelbase) from the middle.

    ``motors`` are the models of the wheels' motors by name, as calibration finds them: of every wheel, or of none. With
    them the feedforward is theirs, in place of ``ks``, ``kv`` and ``ka`` of the gains, and the integral acts at a steady
    setpoint only. The duty is multiplied by ``motor_voltage_v``, the battery's voltage at which the models hold, over
    the present one (None: it is not).

    A wheel that lags behind while its duty saturates slows the twist by ``saturation_slowdown_per_s`` (share of the
    twist per second), so that the others do not bend the path.
    """

    retired: ClassVar[Mapping[str, Any]] = {
        "max_step_s": MAX_STEP_S,
        "longest_step_s": MAX_STEP_S,
        "saturation_recovery_per_s": SATURATION_RECOVERY_PER_S,
        "regain_per_s": SATURATION_RECOVERY_PER_S,
    }

    max_rim_speed_m_s: float = Field(default=0.35, gt=0, le=10)
    max_duty: int = Field(default=255, ge=1, le=32_767)
    """The wire's full scale, at which the bridge is fully on. No larger duty is ever sent."""
    response_delay_s: float = Field(default=0.05, ge=0, le=0.5)
    scrub_duty: float = Field(default=0.0, ge=0, le=32_767)
    scrub_reach_m: float = Field(default=0.1, gt=0, le=5)
    """Half the wheelbase: how far the wheels are from the middle about which the robot turns."""
    integral_settle_s: float = Field(default=0.0, ge=0, le=5)
    """The integral acts in full once all setpoints have been steady for so long; 0: always."""
    motors: Mapping[str, WheelMotor] = {}
    motor_voltage_v: float | None = Field(default=None, gt=0, le=100)
    saturation_slowdown_per_s: float = Field(default=2.0, ge=0, le=100)


class DriveState(Record, frozen=True):
    """Everything that one step hands to the next; ``stepped_s`` is None until the first.

    ``steady_s``: for how long the setpoints have been steady in what was measured.
    ``held_m_s`` are the setpoints that the motors' models have reached when the present duty comes into force, which is
    held for ``cycle_s``. ``earlier_m_s`` are the setpoints before the last step, where that had no measurement.
    ``offered`` are the last duties with their setpoints: the board's echo tells which of them it obeys.
    ``supply_share`` is the factor that makes up for the battery's voltage.
    ``by_duty``: the duty was commanded, not found by a controller.
    ``wheels_differ``: the wheels of a side are not set to the same speed, so ``limiter`` does not describe the motion.
    ``saturation_scale`` is the share of the twist that is still asked for while a wheel saturates.
    """

    pids: tuple[PidState, ...]
    duty: tuple[int, ...]
    limiter: LimiterState = AT_REST
    stepped_s: float | None = None
    saturation_scale: float = field(
        default=1.0, name="share"
    )  # recorded under its first name, as the next is
    setpoint_m_s: tuple[float, ...] = ()
    acceleration_m_s2: tuple[float, ...] = ()
    wheels_differ: bool = field(default=False, name="loose")
    asked: reference.History = ()
    steady_s: float = 0.0
    held_m_s: tuple[float, ...] = ()
    cycle_s: float = 0.0
    supply_share: float = 1.0
    earlier_m_s: tuple[float, ...] = ()
    offered: tuple[tuple[tuple[int, ...], tuple[float, ...]], ...] = ()
    by_duty: bool = False
