"""A step of load on a wheel: how far it falls behind with the board's loop, and with the host's.

The same motor, in the same steps of 100 us: a gear motor of the simulated robot's data sheet with half of its weight,
without dry friction, driving at 0.2 m/s. The host's loop is the daemon's own (``chefbotd.motion.pid``) with ChefBot's
gains, at 100 Hz: it reads counts of the last 50 ms, and its duty takes effect 10 ms later. The board's is the core in
the host build, with gains as high as the wheel allows: damping 0.7 at 22 rad/s.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from chefbotd.components.simulation.parameters.motor import MotorParameters
from chefbotd.motion import pid
from tests.firmware import host

STEP_S = 1e-4
SPEED_RAD_S = 4.5
RADIUS_M = 0.045
COUNTS_PER_TURN = 8400
LOAD_N_M = 0.3
"""A sixth of the motor's stall torque; it comes after a second."""

MOTOR = MotorParameters()
INERTIA_KG_M2 = MOTOR.rotor_inertia_kg_m2 + 5.6 / 2 * RADIUS_M**2
TORQUE_PER_DUTY = MOTOR.torque_constant_n_m_a * MOTOR.rated_voltage_v / MOTOR.resistance_ohm / 255
TORQUE_PER_RAD_S = MOTOR.torque_constant_n_m_a * MOTOR.back_emf_constant_v_s / MOTOR.resistance_ohm
DUTY_PER_RAD_S = TORQUE_PER_RAD_S / TORQUE_PER_DUTY

Controller = Callable[[float, int], int]
"""Called each step with the time and the counts of the wheel: the duty."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How far the rim falls behind at most, and how long until it is within a fiftieth of its speed for good."""

    behind_mm: float
    recovered_ms: float


def fall_behind(controller: Controller, seconds: float = 3.0) -> Outcome:
    """Drive steadily for a second, then with the load."""
    angle, speed = 0.0, SPEED_RAD_S
    behind_rad, most_rad, last_slow_s = 0.0, 0.0, 0.0
    for step in range(round(seconds / STEP_S)):
        now_s = step * STEP_S
        is_loaded = now_s >= 1.0
        duty = controller(now_s, math.floor(angle / math.tau * COUNTS_PER_TURN))
        torque = TORQUE_PER_DUTY * duty - TORQUE_PER_RAD_S * speed - (LOAD_N_M if is_loaded else 0.0)
        speed += torque / INERTIA_KG_M2 * STEP_S
        angle += speed * STEP_S
        if is_loaded:
            behind_rad += (SPEED_RAD_S - speed) * STEP_S
            most_rad = max(most_rad, behind_rad)
            if abs(speed - SPEED_RAD_S) > SPEED_RAD_S / 50:
                last_slow_s = now_s - 1.0
    return Outcome(most_rad * RADIUS_M * 1000, last_slow_s * 1000)


def hosts_loop() -> Controller:
    """The daemon's loop at the end of its line."""
    gains = pid.PidParameters(
        kp_duty_per_m_s=200.0,
        ki_duty_per_m=2000.0,
        kv_duty_per_m_s=DUTY_PER_RAD_S / RADIUS_M,
        output_limit_duty=255.0,
        integral_limit_duty=75.0,
        back_calculation_s=0.5,
    )
    state, readings, duties = pid.RESET, [0], [round(DUTY_PER_RAD_S * SPEED_RAD_S)] * 2

    def control(now_s: float, count: int) -> int:
        nonlocal state
        if round(now_s / STEP_S) % 100 == 0:
            readings.append(count)
            del readings[:-6]
            over_s = 0.01 * (len(readings) - 1)
            measured = (readings[-1] - readings[0]) / over_s / COUNTS_PER_TURN * math.tau * RADIUS_M
            state, duty = pid.step(gains, state, SPEED_RAD_S * RADIUS_M, 0.0, measured, 0.01)
            duties.append(round(duty))
        return duties[-2]

    return control


def boards_loop() -> Controller:
    """The core's loop, repeated by the host 20 times a second."""
    board = host.Board()
    board.hello(250)
    gains = (COUNTS_PER_TURN, 50 * 256, 1300 * 256, round(DUTY_PER_RAD_S * 256), 0)
    for parameter, value in enumerate(gains):
        board.seal(f"g {parameter} {value}")
    counted = 0

    def control(now_s: float, count: int) -> int:
        nonlocal counted
        board.edges(0, count - counted)
        counted = count
        if round(now_s / STEP_S) % 500 == 0:
            board.seal(f"w {round(SPEED_RAD_S * 1000)} 0")
        board.run_us(100)
        return board.duty[0]

    return control
