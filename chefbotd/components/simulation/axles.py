"""Axles that drive one robot: their motion over one step, solved exactly, and dry friction on top."""

import math
from collections.abc import Iterable, Sequence
from itertools import product
from operator import mul
from typing import TypeAlias

import numpy as np

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.chassis import Chassis

FRICTION_SWEEPS = 8

Wheels: TypeAlias = tuple[float, ...]
"""A number for each wheel, in the order of the chassis."""

Rows: TypeAlias = tuple[Wheels, ...]
"""A matrix."""


CREEP_M_S = 0.02
"""A tyre that rolls so much faster or slower than the others of its side grips in full (assumed)."""


def tyre_damping(chassis: Chassis, grip_n: float) -> Vector | None:
    """The N x N damping of axles by tyres that roll faster or slower than the others of their side.

    ``grip_n`` is the grip of a wheel. None: no side has two wheels.
    """
    wheels = chassis.wheels
    if len(wheels) == 2 or not grip_n:
        return None
    damping = np.zeros((len(wheels), len(wheels)))
    for i, wheel in enumerate(wheels):
        on_side = chassis.on_side_of(wheel)
        for j, other in enumerate(wheels):
            if wheel.is_left == other.is_left:
                share = (i == j) - 1 / on_side
                damping[i, j] = grip_n / CREEP_M_S * wheel.radius_m * other.radius_m * share
    return damping


class Propagator:
    """Exact solution over one step of ``inertia * acceleration = torque - damping * velocity``.

    ``own_gain`` is what the solution for dry friction takes for a wheel's response to its own torque; tyres make the
    others of its side respond alike.
    """

    def __init__(
        self, inertia_kg_m2: Vector, damping_n_m_s: float, step_s: float, tyres: Vector | None = None
    ) -> None:
        if tyres is not None:
            self._couple(inertia_kg_m2, damping_n_m_s * np.eye(len(tyres)) + tyres, step_s)
            return
        inertias, axes = np.linalg.eigh(inertia_kg_m2)
        rates = damping_n_m_s / inertias
        responses = step_s / inertias
        if damping_n_m_s > 0:
            responses = -np.expm1(-rates * step_s) / damping_n_m_s
        self.decay = rows(axes @ np.diag(np.exp(-rates * step_s)) @ axes.T)
        self.gain = rows(axes @ np.diag(responses) @ axes.T)
        self.own_gain = [row[wheel] for wheel, row in enumerate(self.gain)]

    def _couple(self, inertia_kg_m2: Vector, damping: Vector, step_s: float) -> None:
        """Solve in the axes of the damping as the square root of the inertia scales it."""
        root = np.linalg.cholesky(inertia_kg_m2)
        unscaled = np.linalg.inv(root)
        rates, axes = np.linalg.eigh(unscaled @ damping @ unscaled.T)
        responses = np.array([-math.expm1(-rate * step_s) / rate if rate > 0 else step_s for rate in rates])
        self.decay = rows(unscaled.T @ axes @ np.diag(np.exp(-rates * step_s)) @ axes.T @ root.T)
        self.gain = rows(unscaled.T @ axes @ np.diag(responses) @ axes.T @ unscaled)
        self.own_gain = [sum(map(abs, row)) for row in self.gain]


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """The scalar product."""
    total: float = sum(map(mul, a, b))
    return total


def times(rows: Rows, column: Iterable[float]) -> list[float]:
    """The product of a matrix and a vector."""
    values = tuple(column)
    return [sum(map(mul, row, values)) for row in rows]


def rows(matrix: Vector) -> Rows:
    """A matrix of plain numbers."""
    return tuple([tuple(row) for row in matrix.tolist()])


def stick_or_slide(propagator: Propagator, free: list[float], limit: list[float]) -> Wheels:
    """Solve for dry friction by projected Jacobi steps. A wheel stands if friction below its limit can hold it."""
    gain, own_gain = propagator.gain, propagator.own_gain
    torque, moving = [0.0] * len(free), free
    for _ in range(FRICTION_SWEEPS):
        before = torque
        wheels = zip(torque, moving, own_gain, limit, strict=True)
        torque = [min(max(was + speed / own, -most), most) for was, speed, own, most in wheels]
        if torque == before:
            break
        moving = [a - b for a, b in zip(free, times(gain, torque), strict=True)]
    rubbed = zip(torque, moving, limit, strict=True)
    return tuple([0.0 if abs(rubs) < most else speed for rubs, speed, most in rubbed])


def by_direction(
    inertia: Vector, damping_n_m_s: float, step_s: float, chassis: Chassis, tyres: Vector | None = None
) -> dict[tuple[bool, ...], Propagator]:
    """The solution for each combination of directions (whether a wheel turns forward).

    A factor on a wheel's time constant is one on the inertia that it feels.
    """
    shared: dict[tuple[float, ...], Propagator] = {}
    solutions = {}
    for directions in product((False, True), repeat=len(chassis.wheels)):
        motors = [
            wheel.forward if ahead else wheel.reverse
            for wheel, ahead in zip(chassis.wheels, directions, strict=True)
        ]
        factors = tuple([motor.time_constant for motor in motors])
        if factors not in shared:
            scale = np.sqrt(factors)
            scaled = inertia * np.outer(scale, scale)
            shared[factors] = Propagator(scaled, damping_n_m_s, step_s, tyres)
        solutions[directions] = shared[factors]
    return solutions
