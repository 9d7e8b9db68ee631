"""One board cycle's work by part, in microseconds: the daemon's own functions on the same values, without a loop.

In a tight loop the caches are warm, so these are lower bounds of what the parts cost in the running daemon.
"""

import time
from collections.abc import Callable

import numpy as np

from benchmarks.decode import made_up_capture
from benchmarks.figures import Figure
from chefbotd.api.fanout import Feed
from chefbotd.api.topics import topics
from chefbotd.core.events import OdometryUpdated, WheelsDriven
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.link.board_clock import BoardClock
from chefbotd.motion import encoder, odometry
from chefbotd.motion.drive import Drive
from chefbotd.motion.kinematics import Kinematics
from chefbotd.safety import gate
from chefbotd.sensing import battery, imu, ultrasonic
from chefbotd.settings import Settings, load
from firmware_protocol.codec import CLASSIC, from_board
from firmware_protocol.decoder import Decoder

CYCLES = 2000
PERIOD_S = 0.01
TWIST = Twist2D(0.1, 0.4)

Step = Callable[[int], object]


def run() -> tuple[Figure, ...]:
    """Microseconds per cycle of parsing, board clock, control, odometry, sensors and JSON."""
    settings = load()
    steps = {
        "parsing": _parsing(),
        "board clock": _board_clock(),
        "control": _control(settings),
        "odometry": _odometry(settings),
        "sensors": _sensors(settings),
        "JSON of odometry and wheels": _json(settings),
    }
    return tuple(Figure(name, _microseconds(step), "us") for name, step in steps.items())


def _microseconds(step: Step) -> float:
    began_s = time.perf_counter()
    for cycle in range(CYCLES):
        step(cycle)
    return (time.perf_counter() - began_s) / CYCLES * 1e6


def _parsing() -> Step:
    lines = made_up_capture(CYCLES).splitlines(keepends=True)
    cycles = [b"".join(lines[i : i + 6]) for i in range(0, len(lines), 6)]
    decoder = Decoder(from_board(CLASSIC))
    return lambda cycle: decoder.feed(cycles[cycle])


def _board_clock() -> Step:
    clock = BoardClock()
    return lambda cycle: clock.observe(round(cycle * PERIOD_S * 1e6), PERIOD_S, 100 + cycle * PERIOD_S)


def _control(settings: Settings) -> Step:
    """Decode the counts, ask the gate, regulate: what the drive service does with an encoder frame."""
    wheels = settings.chassis.wheels
    drive = Drive(settings.drive, settings.chassis, settings.limits, (settings.pid,) * len(wheels))
    signs = tuple(wheel.encoder_sign for wheel in wheels)
    encoders, state = encoder.START, drive.at_rest
    asked = gate.accept(settings.safety, gate.GateState(), gate.Command("teleop", TWIST, 0.0))

    def step(cycle: int) -> object:
        nonlocal encoders, state
        counts = (cycle * 9, cycle * 21)
        encoders, reading = encoder.decode(settings.encoders, signs, encoders, counts, cycle * PERIOD_S)
        decision = gate.decide(settings.safety, asked, 0.0)
        now_s = cycle * PERIOD_S
        state = drive.regulate(state, decision.twist, now_s, reading.velocity_rad_s, PERIOD_S)
        return state

    return step


def _odometry(settings: Settings) -> Step:
    kinematics, state = Kinematics(settings.chassis), odometry.START

    def step(cycle: int) -> object:
        nonlocal state
        left_m, right_m = kinematics.side_travel_m((0.013, 0.031))
        twist = kinematics.twist((1.3, 3.1))
        state = odometry.integrate(settings.odometry, kinematics.track_width_m, state, left_m, right_m, twist)
        return state

    return step


def _sensors(settings: Settings) -> Step:
    charge = battery.START

    def step(cycle: int) -> object:
        return (
            ultrasonic.interpret(settings.ultrasonic, 0.0, 123),
            imu.from_quaternion(settings.imu, 0.0, 0.01, -0.02, 0.71, 0.71),
            battery.measure(settings.battery, charge, 0.0, 3050.0),
        )

    return step


def _json(settings: Settings) -> Step:
    table = topics(tuple(wheel.name for wheel in settings.chassis.wheels), simulated=False)
    feeds = Feed(table["odometry"]), Feed(table["wheels"])
    pose = OdometryUpdated(1.5, Pose2D(0.123456789, -1.23456789, 0.7), TWIST, np.full((3, 3), 1.234567e-5))
    driven = WheelsDriven(1.5, (12.345678, 23.456789), (1.234567, 3.123456), (1.3, 3.1), (123, 234))

    def step(cycle: int) -> object:
        for feed, event in zip(feeds, (pose, driven), strict=True):
            feed.take(event)
            feed.line(1.6)
        return feeds

    return step
