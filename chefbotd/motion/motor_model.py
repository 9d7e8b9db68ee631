"""A motor's model by direction, and the feedforward that inverts it from one command of the board's cycle to the next.

Beyond a dead zone (dry friction and the bridge) the steady speed is in proportion to the duty, and it is approached
with one time constant. A duty that is held for a cycle ``T`` takes the speed from ``v`` to ``r`` if it is that of the
steady speed ``v + (r - v) / (1 - exp(-T / lag))`` (the inverse of the sampled plant: Astrom and Wittenmark,
"Computer-Controlled Systems", 3rd ed., ch. 2 and 5). As a duty per acceleration ``(r - v) / T`` that is ``lag`` times
``1 - x / 2 + x^2 / 12 - ...`` with ``x = T / lag``; the next term, ``x^4 / 720``, is below 1 % of it up to 2 of ``x``.
"""

from collections.abc import Mapping, Sequence

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.motion.pid import PidParameters


class MotorModel(Parameters):
    """A motor in one direction: its wheel turns at ``gain_rad_s_per_duty`` of what the duty exceeds the dead zone by."""

    dead_zone_duty: float = Field(ge=0, le=32_767)
    """The duty that friction takes: below it the wheel does not turn."""
    gain_rad_s_per_duty: float = Field(gt=0, le=100)
    """How much faster the wheel turns for each count of duty beyond the dead zone."""
    time_constant_s: float = Field(gt=0, le=2)
    """How long the wheel takes for 63 % of a change of its speed."""


class WheelMotor(Parameters):
    """A wheel's motor in both directions."""

    forward: MotorModel
    reverse: MotorModel


LONGEST_LAGS = 2.0
"""A cycle counts as no longer than this many time constants in the series."""


class Directed(Record, frozen=True):
    """A wheel's gains in each direction, with the model's feedforward."""

    forward: PidParameters
    reverse: PidParameters


def direct_gains(gains: PidParameters, motor: WheelMotor, radius_m: float) -> Directed:
    """The gains with each direction's feedforward, for a wheel of this radius: ``ka`` over ``kv`` is the lag."""
    return Directed(_with_model(gains, motor.forward, radius_m), _with_model(gains, motor.reverse, radius_m))


def _with_model(gains: PidParameters, model: MotorModel, radius_m: float) -> PidParameters:
    kv = 1 / (model.gain_rad_s_per_duty * radius_m)
    return gains.model_copy(update={"ks": model.dead_zone_duty, "kv": kv, "ka": kv * model.time_constant_s})


def accelerations_m_s2(
    gains: Sequence[PidParameters],
    held_m_s: Sequence[float],
    setpoint_m_s: Sequence[float],
    cycle_s: float,
    most_m_s2: float,
) -> tuple[float, ...]:
    """What the feedforward takes for each wheel's acceleration, from what is held now to the setpoint in a cycle.

    None is more than ``most_m_s2``: a cycle may be mistaken for a shorter one.
    """
    accelerations = []
    for wheel, held, setpoint in zip(gains, held_m_s, setpoint_m_s, strict=True):
        lags, change = cycle_s * wheel.kv / wheel.ka, (setpoint - held) / cycle_s
        lags = lags if lags < LONGEST_LAGS else LONGEST_LAGS
        change = most_m_s2 if change > most_m_s2 else -most_m_s2 if change < -most_m_s2 else change
        accelerations.append(change * (1 - lags / 2 + lags * lags / 12))
    return tuple(accelerations)


class MotorModels:
    """The models of all wheels' motors, or none where they are not known.

    Raises:
        ValueError: those of some wheels only.
    """

    def __init__(
        self, motors: Mapping[str, WheelMotor], names: Sequence[str], radii_m: Sequence[float]
    ) -> None:
        if motors and motors.keys() != set(names):
            raise ValueError(
                f"drive.motors must name every wheel ({', '.join(names)}), got {', '.join(motors)}"
            )
        self.are_known = bool(motors)
        self._motors = tuple([motors[name] for name in names]) if motors else ()
        self._radii_m = radii_m

    def directed(self, gains: Sequence[PidParameters]) -> tuple[Directed, ...]:
        """The gains of each wheel by direction; empty where the motors are not known."""
        wheels = zip(gains, self._motors, self._radii_m, strict=True) if self._motors else ()
        return tuple([direct_gains(*wheel) for wheel in wheels])
