"""The drive train: DC gear motors, wheels and the robot's own mass, stepped exactly over a fixed time.

The motor is the textbook one without inductance (Lynch and Park, *Modern Robotics*, section 8.9.1)::

    voltage = resistance * current + back_emf_constant * speed      torque = torque_constant * current

which makes the wheels a linear system between two friction forces. It is solved exactly (matrix
exponential), so a step of any length is stable; dry friction is then found as the torque, within its bounds,
that stops each wheel. Wheels come in the order of the chassis, however many there are on a side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chefbotd.core.geometry import Twist2D
from chefbotd.sim.arrays import Vector
from chefbotd.sim.chassis import PUBLISHED, Chassis
from chefbotd.sim.scrub import Scrub
from chefbotd.sim_parameters.motor import GRAVITY_M_S2, BodyParameters, MotorParameters

FRICTION_SWEEPS = 8


@dataclass(frozen=True, slots=True)
class Supply:
    """What feeds the bridges: a voltage behind a resistance, and what the electronics take of it."""

    open_circuit_v: float
    resistance_ohm: float = 0.0
    base_load_a: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class WheelState:
    """Angle turned since power-on and speed of every wheel, forward positive."""

    angle_rad: Vector
    velocity_rad_s: Vector


class _Propagator:
    """Exact solution over one step of ``inertia * acceleration = torque - damping * velocity``."""

    def __init__(self, inertia_kg_m2: Vector, damping_n_m_s: float, step_s: float) -> None:
        inertias, axes = np.linalg.eigh(inertia_kg_m2)
        rates = damping_n_m_s / inertias
        responses = step_s / inertias
        if damping_n_m_s > 0:
            responses = -np.expm1(-rates * step_s) / damping_n_m_s
        self.decay: Vector = axes @ np.diag(np.exp(-rates * step_s)) @ axes.T
        self.gain: Vector = axes @ np.diag(responses) @ axes.T
        self.own_gain: Vector = np.diag(self.gain).copy()


class Plant:
    """Steps the wheels of one robot; holds constants only, the state goes through ``step``."""

    def __init__(
        self, motor: MotorParameters, body: BodyParameters, step_s: float, chassis: Chassis = PUBLISHED
    ) -> None:
        """Raises ``ValueError`` unless ``step_s`` is positive."""
        if not step_s > 0:
            raise ValueError(f"step_s must be positive, got {step_s}")
        self.step_s = step_s
        self._dead_zone_share = motor.dead_zone_share
        self._twist_from_wheels = _twist_from_wheels(body, chassis)
        inertia = _inertia(motor, body, self._twist_from_wheels)
        self._resistance_ohm, self._back_emf_v_s = motor.resistance_ohm, motor.back_emf_constant_v_s
        self._stall_n_m_per_v = motor.torque_constant_n_m_a / motor.resistance_ohm
        magnetic = self._stall_n_m_per_v * self._back_emf_v_s
        self._driven = _Propagator(inertia, motor.viscous_friction_n_m_s + magnetic, step_s)
        self._coasting = _Propagator(inertia, motor.viscous_friction_n_m_s, step_s)
        wheels = len(chassis.wheels)
        radii_m, load_n = _radii_m(body, chassis), body.mass_kg * GRAVITY_M_S2 / wheels
        self._static_to_kinetic = motor.static_to_kinetic_friction
        self._kinetic_n_m = motor.dry_friction_n_m + body.rolling_resistance * load_n * radii_m
        self._spinning_n_m = body.grip * load_n * radii_m
        self._scrub = Scrub(chassis, body.wheelbase_m, radii_m, body.grip * load_n)
        self._open = np.zeros(wheels)

    @property
    def standing(self) -> WheelState:
        """Wheels at rest at angle 0."""
        return WheelState(self._open, self._open)

    def pulse_width(self, shares: Sequence[float]) -> Vector:
        """The signed share of the supply that each wheel's bridge passes on for its PWM share (-1 to 1).

        Pulses inside the dead zone are too short to switch.

        Raises:
            ValueError: there are not as many shares as wheels.
        """
        if len(shares) != len(self._open):
            raise ValueError(f"{len(shares)} PWM shares for {len(self._open)} wheels")
        asked, dead = np.asarray(shares, dtype=np.float64), self._dead_zone_share
        return np.copysign(np.clip((np.abs(asked) - dead) / (1 - dead), 0.0, 1.0), asked)

    def load(self, state: WheelState, pulse_width: Vector | None, supply: Supply) -> tuple[float, float]:
        """The voltage left of the supply, and the current drawn from it, electronics included.

        A bridge draws ``pulse_width`` times its motor's current, so both follow in closed form; braking into
        the supply raises its voltage.
        """
        conductance = back_emf_a = 0.0
        if pulse_width is not None:
            conductance = float(pulse_width @ pulse_width) / self._resistance_ohm
            back_emf_a = float(pulse_width @ state.velocity_rad_s) * self._back_emf_v_s / self._resistance_ohm
        unloaded_v = supply.open_circuit_v - supply.resistance_ohm * (supply.base_load_a - back_emf_a)
        terminal_v = unloaded_v / (1 + supply.resistance_ohm * conductance)
        return terminal_v, supply.base_load_a + conductance * terminal_v - back_emf_a

    def step(
        self, state: WheelState, pulse_width: Vector | None, terminal_v: float, skid: float = 0.0
    ) -> WheelState:
        """The state ``step_s`` later.

        Args:
            state: the wheels now.
            pulse_width: from ``pulse_width``; 0 shorts the motor (both bridge inputs high: it brakes);
                None opens every bridge (the motors coast).
            terminal_v: from ``load``.
            skid: share of the wheels' grip that is overcome because the robot is held by something.
        """
        velocity = state.velocity_rad_s
        if not velocity.any() and (pulse_width is None or not pulse_width.any()):
            return state
        if pulse_width is None:
            propagator, free = self._coasting, self._coasting.decay @ velocity
        else:
            torque = (self._stall_n_m_per_v * terminal_v) * pulse_width
            propagator = self._driven
            free = propagator.decay @ velocity + propagator.gain @ torque
        after = self._rub(propagator, velocity, free, skid)
        return WheelState(state.angle_rad + (0.5 * self.step_s) * (velocity + after), after)

    def _rub(self, propagator: _Propagator, velocity: Vector, free: Vector, skid: float) -> Vector:
        """Velocities after dry friction, given those without it."""
        kinetic = self._kinetic_n_m + (
            skid * self._spinning_n_m + self._scrub.torque_n_m(self.twist(velocity))
        )
        after: Vector = free - propagator.gain @ np.copysign(kinetic, velocity)
        if (after * velocity).min() > 0:
            return after
        limit = np.where(velocity == 0, kinetic * self._static_to_kinetic, kinetic)
        return _stick_or_slide(propagator, free, limit)

    def twist(self, wheel_velocity_rad_s: Vector) -> Twist2D:
        """How the robot moves over free ground; a side moves with the mean of its rims."""
        linear, angular = self._twist_from_wheels @ wheel_velocity_rad_s
        return Twist2D(float(linear), float(angular))


def _stick_or_slide(propagator: _Propagator, free: Vector, limit: Vector) -> Vector:
    """Projected Gauss-Jacobi: a wheel whose friction need not reach its limit to stop it, stands."""
    torque = np.zeros_like(limit)
    for _ in range(FRICTION_SWEEPS):
        residual = free - propagator.gain @ torque
        torque = np.minimum(np.maximum(torque + residual / propagator.own_gain, -limit), limit)
    return np.where(np.abs(torque) < limit, 0.0, free - propagator.gain @ torque)


def _radii_m(body: BodyParameters, chassis: Chassis) -> Vector:
    """The wheels' real radii."""
    left, right = body.left_radius_multiplier, body.right_radius_multiplier
    return np.array([wheel.radius_m * (left if wheel.is_left else right) for wheel in chassis.wheels])


def _twist_from_wheels(body: BodyParameters, chassis: Chassis) -> Vector:
    """The 2 x N matrix from wheel speeds to (forward m/s, CCW rad/s)."""
    columns = []
    for wheel, radius_m in zip(chassis.wheels, _radii_m(body, chassis), strict=True):
        grips = 1 - (body.left_slip if wheel.is_left else body.right_slip)
        rim_m, sign = radius_m * grips / chassis.on_side_of(wheel), -1 if wheel.is_left else 1
        columns.append((rim_m / 2, sign * rim_m / chassis.track_width_m))
    return np.array(columns).T


def _inertia(motor: MotorParameters, body: BodyParameters, twist_from_wheels: Vector) -> Vector:
    """The N x N inertia that the axles feel: rotors, and the robot's mass through the wheels."""
    moved = np.diag([body.mass_kg, body.yaw_inertia_kg_m2 if body.mass_kg else 0.0])
    carried: Vector = twist_from_wheels.T @ moved @ twist_from_wheels
    return motor.rotor_inertia_kg_m2 * np.eye(twist_from_wheels.shape[1]) + carried
