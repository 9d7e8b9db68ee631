"""The drive train: DC gear motors, wheels and the robot's own mass, stepped exactly over a fixed time.

The motor is the textbook one without inductance (Lynch and Park, *Modern Robotics*, section 8.9.1)::

    voltage = resistance * current + back_emf_constant * speed      torque = torque_constant * current

which makes the wheels a linear system between two friction forces. It is solved exactly (matrix
exponential), so a step of any length is stable; dry friction is then found as the torque, within its bounds,
that stops each wheel. Wheels come in the order of the chassis, however many there are on a side.

A step is written with plain numbers: with two or four wheels, numpy's calls cost more than the sums.
"""

from collections.abc import Sequence
from math import copysign
from operator import mul

import numpy as np

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.axles import (
    Propagator,
    Wheels,
    by_direction,
    dot,
    rows,
    stick_or_slide,
    times,
    tyre_damping,
)
from chefbotd.components.simulation.chassis import PUBLISHED, Chassis, Scrub
from chefbotd.components.simulation.parameters.motor import (
    GRAVITY_M_S2,
    STATIC_TO_KINETIC_FRICTION,
    MotorParameters,
    SimBodyParameters,
)
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import Record


class Supply(Record, frozen=True):
    """The supply of the bridges: a voltage behind a resistance, less the current of the electronics."""

    open_circuit_v: float
    resistance_ohm: float = 0.0
    base_load_a: float = 0.0


class WheelState(Record, frozen=True):
    """Angle turned since power-on and speed of every wheel, forward positive."""

    angle_rad: Wheels
    velocity_rad_s: Wheels


class Push(Record, frozen=True):
    """A force on the robot's middle, along its own axes, and a torque about its vertical axis, CCW positive."""

    forward_n: float = 0.0
    leftward_n: float = 0.0
    turn_n_m: float = 0.0


class AxleDrive(Record, frozen=True):
    """What acts on each axle: the motor's torque at standstill, what speed takes off it, and dry friction.

    ``inertia_kg_m2`` is what is to be added to the axle's inertia for its time constant.
    """

    torque_n_m: Wheels
    damping_n_m_s: float
    dry_n_m: Wheels
    inertia_kg_m2: Wheels


class MotorCurve(Record, frozen=True):
    """A motor in one direction: steady speed is ``gain_rad_s * (share - dead_zone_share)`` of a PWM share.

    It is approached with the time constant, while all wheels turn alike (straight ahead).
    """

    dead_zone_share: float
    gain_rad_s: float
    time_constant_s: float


class Plant:
    """Steps the wheels of one robot; holds constants only, the state goes through ``step``."""

    def __init__(
        self, motor: MotorParameters, body: SimBodyParameters, step_s: float, chassis: Chassis = PUBLISHED
    ) -> None:
        """Raises ``ValueError`` unless ``step_s`` is positive."""
        if not step_s > 0:
            raise ValueError(f"step_s must be positive, got {step_s}")
        self.step_s = step_s
        self._set_flaws(motor, chassis)
        twist_from_wheels = _twist_from_wheels(chassis)
        self._linear_from_wheels, self._angular_from_wheels = rows(twist_from_wheels)
        inertia = _inertia(motor, body, twist_from_wheels)
        self._resistance_ohm, self._back_emf_v_s = motor.resistance_ohm, motor.back_emf_constant_v_s
        self._stall_n_m_per_v = motor.torque_constant_n_m_a / motor.resistance_ohm
        magnetic = self._stall_n_m_per_v * self._back_emf_v_s
        viscous = self._viscous_n_m_s = motor.viscous_friction_n_m_s
        self._damping_n_m_s, self._straight_kg_m2 = viscous + magnetic, inertia.sum(axis=1).tolist()
        wheels = len(chassis.wheels)
        radii_m, load_n = [wheel.radius_m for wheel in chassis.wheels], body.mass_kg * GRAVITY_M_S2 / wheels
        tyres = tyre_damping(chassis, body.grip * load_n)
        self._driven = by_direction(inertia, viscous + magnetic, step_s, chassis, tyres)
        self._coasting = by_direction(inertia, viscous, step_s, chassis, tyres)
        self._static_to_kinetic = STATIC_TO_KINETIC_FRICTION
        rolling_n = body.rolling_resistance * load_n
        self._kinetic_n_m = [motor.dry_friction_n_m + rolling_n * radius_m for radius_m in radii_m]
        self._spinning_n_m = [body.grip * load_n * radius_m for radius_m in radii_m]
        self._scrub = Scrub(chassis, body.wheelbase_m, radii_m, body.grip * load_n)
        self._open: Wheels = (0.0,) * wheels

    def _set_flaws(self, motor: MotorParameters, chassis: Chassis) -> None:
        """Each wheel's dead zone, and the factors on its drive and its friction, by direction (reverse, forward)."""
        flaws = self._motors = [(wheel.reverse, wheel.forward) for wheel in chassis.wheels]
        self._dead_zones = [
            tuple([motor.dead_zone_share * flaw.dead_zone for flaw in pair]) for pair in flaws
        ]
        self._gains = [tuple([flaw.gain for flaw in pair]) for pair in flaws]
        self._frictions = [tuple([flaw.gain * flaw.dead_zone for flaw in pair]) for pair in flaws]

    @property
    def standing(self) -> WheelState:
        """Wheels at rest at angle 0."""
        return WheelState(self._open, self._open)

    def pulse_width(self, shares: Sequence[float]) -> Wheels:
        """The signed share of the supply that each wheel's bridge passes on for its PWM share (-1 to 1).

        Pulses inside the dead zone are too short to switch.

        Raises:
            ValueError: there are not as many shares as wheels.
        """
        if len(shares) != len(self._open):
            raise ValueError(f"{len(shares)} PWM shares for {len(self._open)} wheels")
        dead_zones = [zones[asked > 0] for zones, asked in zip(self._dead_zones, shares, strict=True)]
        return tuple(
            [
                copysign(min(max((abs(asked) - dead) / (1 - dead), 0.0), 1.0), asked)
                for asked, dead in zip(shares, dead_zones, strict=True)
            ]
        )

    def curve(self, wheel: int, terminal_v: float, *, forward: bool) -> MotorCurve:
        """How this wheel answers to duty at this voltage; what turning costs by skidding is left out."""
        motor = self._motors[wheel][forward]
        dead, stall_n_m = self._dead_zones[wheel][forward], self._stall_n_m_per_v * terminal_v
        friction = motor.dead_zone * self._kinetic_n_m[wheel] / stall_n_m
        return MotorCurve(
            dead + (1 - dead) * friction,
            motor.gain * stall_n_m / self._damping_n_m_s / (1 - dead),
            motor.time_constant * self._straight_kg_m2[wheel] / self._damping_n_m_s,
        )

    def load(self, state: WheelState, pulse_width: Wheels | None, supply: Supply) -> tuple[float, float]:
        """The voltage left of the supply, and the current drawn from it, electronics included.

        A bridge draws ``pulse_width`` times its motor's current, so both follow in closed form; braking into
        the supply raises its voltage.
        """
        conductance = back_emf_a = 0.0
        if pulse_width is not None:
            conductance = dot(pulse_width, pulse_width) / self._resistance_ohm
            back_emf_a = dot(pulse_width, state.velocity_rad_s) * self._back_emf_v_s / self._resistance_ohm
        unloaded_v = supply.open_circuit_v - supply.resistance_ohm * (supply.base_load_a - back_emf_a)
        terminal_v = unloaded_v / (1 + supply.resistance_ohm * conductance)
        return terminal_v, supply.base_load_a + conductance * terminal_v - back_emf_a

    def step(
        self,
        state: WheelState,
        pulse_width: Wheels | None,
        terminal_v: float,
        skid: float = 0.0,
        push: Push | None = None,
    ) -> WheelState:
        """The state ``step_s`` later.

        Args:
            state: the wheels now.
            pulse_width: from ``pulse_width``; 0 shorts the motor (both bridge inputs high: it brakes);
                None opens every bridge (the motors coast).
            terminal_v: from ``load``.
            skid: share of the wheels' grip that is overcome because the robot is held by something.
            push: what pushes the robot besides its motors.
        """
        velocity = state.velocity_rad_s
        if push is None and not any(velocity) and (pulse_width is None or not any(pulse_width)):
            return state
        forward = tuple(map(_is_forward, velocity, pulse_width or velocity))
        if pulse_width is None:
            propagator = self._coasting[forward]
            free = times(propagator.decay, velocity)
        else:
            propagator, n_m = self._driven[forward], self._stall_n_m_per_v * terminal_v
            wheels = zip(self._gains, forward, pulse_width, strict=True)
            driven = times(propagator.gain, [n_m * gain[ahead] * share for gain, ahead, share in wheels])
            free = [a + b for a, b in zip(times(propagator.decay, velocity), driven, strict=True)]
        if push is not None:
            free = [a + b for a, b in zip(free, times(propagator.gain, self._at_axles(push)), strict=True)]
        frictions = zip(self._kinetic_n_m, self._frictions, forward, strict=True)
        dry_n_m = [n_m * factor[ahead] for n_m, factor, ahead in frictions]
        after = self._rub(propagator, velocity, free, dry_n_m, skid)
        half_s = 0.5 * self.step_s
        turned = zip(state.angle_rad, velocity, after, strict=True)
        return WheelState(tuple([angle + half_s * (old + new) for angle, old, new in turned]), after)

    def _rub(
        self, propagator: Propagator, velocity: Wheels, free: list[float], dry_n_m: list[float], skid: float
    ) -> Wheels:
        """Velocities after dry friction, given those without it."""
        resistances = (dry_n_m, self._spinning_n_m, self._scrub.torque_n_m(self.twist(velocity)))
        kinetic = [dry + skid * spinning + scrub for dry, spinning, scrub in zip(*resistances, strict=True)]
        slowed = times(propagator.gain, map(copysign, kinetic, velocity))
        after = tuple([a - b for a, b in zip(free, slowed, strict=True)])
        if min(map(mul, after, velocity)) > 0:
            return after
        more = self._static_to_kinetic
        limit = [torque if speed else torque * more for torque, speed in zip(kinetic, velocity, strict=True)]
        return stick_or_slide(propagator, free, limit)

    def _at_axles(self, push: Push) -> list[float]:
        """The torque of a push at each axle."""
        wheels = zip(self._linear_from_wheels, self._angular_from_wheels, strict=True)
        return [linear * push.forward_n + angular * push.turn_n_m for linear, angular in wheels]

    def axles(self, state: WheelState, pulse_width: Wheels | None, terminal_v: float) -> AxleDrive:
        """What acts on the axles now, for physics of other kinds than ``step``; arguments as there.

        Dry friction is that of a wheel that turns, or more at one that stands.
        """
        velocity, straight = state.velocity_rad_s, self._straight_kg_m2
        forward = tuple(map(_is_forward, velocity, pulse_width or velocity))
        torque: Wheels = self._open
        if pulse_width is not None:
            n_m = self._stall_n_m_per_v * terminal_v
            wheels = zip(self._gains, forward, pulse_width, strict=True)
            torque = tuple([n_m * gain[ahead] * share for gain, ahead, share in wheels])
        frictions = zip(self._kinetic_n_m, self._frictions, forward, velocity, strict=True)
        more = self._static_to_kinetic
        dry = [n_m * factor[ahead] * (1 if speed else more) for n_m, factor, ahead, speed in frictions]
        flaws = zip(self._motors, forward, straight, strict=True)
        inertia = [(motor[ahead].time_constant - 1) * own for motor, ahead, own in flaws]
        damping = self._viscous_n_m_s if pulse_width is None else self._damping_n_m_s
        return AxleDrive(torque, damping, tuple(dry), tuple(inertia))

    def twist(self, wheel_velocity_rad_s: Sequence[float]) -> Twist2D:
        """The robot's motion over free ground. Each side moves with the mean speed of its rims."""
        return Twist2D(
            dot(self._linear_from_wheels, wheel_velocity_rad_s),
            dot(self._angular_from_wheels, wheel_velocity_rad_s),
        )


def _is_forward(velocity_rad_s: float, share: float) -> bool:
    """Which way a wheel turns, or is about to."""
    return velocity_rad_s > 0 or (velocity_rad_s == 0 and share >= 0)


def _twist_from_wheels(chassis: Chassis) -> Vector:
    """The 2 x N matrix from wheel speeds to (forward m/s, CCW rad/s)."""
    columns = []
    for wheel in chassis.wheels:
        rim_m, sign = wheel.radius_m / chassis.on_side_of(wheel), -1 if wheel.is_left else 1
        columns.append((rim_m / 2, sign * rim_m / chassis.track_width_m))
    return np.array(columns).T


def _inertia(motor: MotorParameters, body: SimBodyParameters, twist_from_wheels: Vector) -> Vector:
    """The N x N inertia that the axles feel: rotors, and the robot's mass through the wheels."""
    moved = np.diag([body.mass_kg, body.yaw_inertia_kg_m2 if body.mass_kg else 0.0])
    carried: Vector = twist_from_wheels.T @ moved @ twist_from_wheels
    return motor.rotor_inertia_kg_m2 * np.eye(twist_from_wheels.shape[1]) + carried
