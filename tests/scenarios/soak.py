"""A long simulated drive with seeded faults, and what must hold at every step of it.

``python -m tests.scenarios.soak MINUTES [SEED]`` runs one on the virtual clock and prints what happened.
"""

import asyncio
import contextlib
import json
import math
import random
import resource
import sys
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from chefbotd import logs
from chefbotd.client import CallError
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import OdometryUpdated, SafetyChanged, WheelsDriven
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import Settings, load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot

SPEED_M_S, TURN_RAD_S = 0.25, 0.9
HOME_M = 0.8
"""Farther from the start than this the robot turns back: the room has walls."""

DRIFT_M, DRIFT_SHARE = 0.03, 0.02
"""Odometry may be so far from the truth: a base, and a share of the way since the two were last set equal."""


@dataclass
class Report:
    """What happened, and the worst of what was measured."""

    minutes: float = 0.0
    control_steps: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    worst_drift_m: float = 0.0
    worst_speed_m_s: float = 0.0
    worst_acceleration_m_s2: float = 0.0
    travelled_m: float = 0.0
    resident_growth_mb: float = 0.0

    def dump(self) -> str:
        """As one JSON object."""
        return json.dumps(
            {k: round(v, 4) if isinstance(v, float) else v for k, v in vars(self).items()}, default=dict
        )


class Invariants:
    """Looks at every control step; raises ``AssertionError`` naming what did not hold."""

    def __init__(self, robot: SimulatedRobot, settings: Settings, report: Report) -> None:
        self._robot, self._report = robot, report
        self._clock = LoopClock()
        self._radius_m = settings.chassis.wheels[0].radius_m
        self._track_m = settings.chassis.track_width_m
        self._limits = settings.limits
        self._inbox = robot.daemon.bus.subscribe(WheelsDriven, SafetyChanged, OdometryUpdated, size=4096)
        self._mode = "armed"
        self._last: WheelsDriven | None = None
        self._drift_allowed_m: float | None = None
        self._truth: Pose2D | None = None

    @property
    def mode(self) -> str:
        """The gate's mode as last told."""
        return self._mode

    async def watch(self) -> None:
        """Check until cancelled."""
        async for event in self._inbox:
            if isinstance(event, SafetyChanged):
                self._mode, self._last = event.mode, None
                if event.fault:
                    self._report.faults[event.fault] += 1
            elif isinstance(event, OdometryUpdated):
                self._check_drift(event)
            else:
                self._check_step(event)

    def encoders_touched(self) -> None:
        """A fault touches the encoders: odometry may be anywhere until it is set again."""
        self._drift_allowed_m = None

    def odometry_set(self) -> None:
        """Odometry was just set to the truth."""
        self._drift_allowed_m = DRIFT_M

    def _check_step(self, step: WheelsDriven) -> None:
        self._report.control_steps += 1
        if self._mode != "armed":
            assert not any(step.duty), f"duty {step.duty} while {self._mode}"
        left, right = (w * self._radius_m for w in step.target_rad_s)
        linear, angular = (left + right) / 2, (right - left) / self._track_m
        self._report.worst_speed_m_s = max(self._report.worst_speed_m_s, abs(linear))
        assert abs(linear) <= self._limits.linear.max_forward_m_s + 1e-9, f"asked for {linear} m/s"
        assert abs(angular) <= self._limits.angular.max_left_rad_s + 1e-9, f"asked for {angular} rad/s"
        if self._last is not None and any(step.target_rad_s):
            self._check_change(self._last, step, linear)
        self._last = step

    def _check_change(self, before: WheelsDriven, after: WheelsDriven, linear: float) -> None:
        """Setpoints change within the limits; only a halt may jump, and only to zero."""
        was = sum(before.target_rad_s) / len(before.target_rad_s) * self._radius_m
        elapsed_s = after.stamp_s - before.stamp_s
        change = abs(linear - was)
        allowed = self._limits.linear.acceleration_m_s2 * (elapsed_s + 0.02) + 1e-6
        assert change <= allowed, f"setpoint changed by {change} m/s in {elapsed_s} s"
        if elapsed_s > 0.01:
            rate = change / elapsed_s
            self._report.worst_acceleration_m_s2 = max(self._report.worst_acceleration_m_s2, rate)

    def _check_drift(self, event: OdometryUpdated) -> None:
        true = self._robot.board.truth(0.0)
        moved_m = 0.0
        if self._truth is not None:
            moved_m = math.dist(
                (true.world_from_base.x_m, true.world_from_base.y_m), (self._truth.x_m, self._truth.y_m)
            )
        self._truth = true.world_from_base
        self._report.travelled_m += moved_m
        if true.in_contact:
            self.encoders_touched()
        if self._drift_allowed_m is None:
            return
        self._drift_allowed_m += DRIFT_SHARE * moved_m
        odom = event.odom_from_base
        drift_m = math.dist((odom.x_m, odom.y_m), (self._truth.x_m, self._truth.y_m))
        self._report.worst_drift_m = max(self._report.worst_drift_m, drift_m)
        assert drift_m <= self._drift_allowed_m, f"odometry {drift_m:.3f} m from the truth"


class Driver:
    """Drives about at random and lets faults happen, all from one seed."""

    def __init__(self, robot: SimulatedRobot, invariants: Invariants, rng: random.Random) -> None:
        self._robot, self._invariants, self._rng = robot, invariants, rng
        self._noise: float = 0.0
        self.injected: Counter[str] = Counter()
        self._faults: tuple[Callable[[], Awaitable[None]], ...] = (
            self.stop,
            self.fall_silent,
            self.press_estop,
            self.pull_the_cable,
            self.reset_the_board,
            self.make_noise,
            self.stall_the_reader,
        )

    async def go(self, minutes: float) -> None:
        """Legs of driving with a fault between them, for so long."""
        clock = LoopClock()
        end_s = clock.now_s() + 60 * minutes
        await asyncio.sleep(1.0)
        await self._start_anew()
        while clock.now_s() < end_s:
            await self._leg()
            fault = self._rng.choice(self._faults)
            self.injected[fault.__name__] += 1
            await fault()
            await self._start_anew()

    async def _leg(self) -> None:
        twist = self._somewhere()
        for _ in range(self._rng.randrange(10, 60)):
            with contextlib.suppress(CallError):
                await self._robot.client.drive(*twist)
            await asyncio.sleep(0.1)

    def _somewhere(self) -> tuple[float, float]:
        """A random twist; towards the start when the robot is far from it."""
        pose = self._robot.board.truth(0.0).world_from_base
        to_home = Pose2D(1.0, 1.0, 0.0)
        if math.dist((pose.x_m, pose.y_m), (to_home.x_m, to_home.y_m)) < HOME_M:
            return self._rng.uniform(-SPEED_M_S, SPEED_M_S), self._rng.uniform(-TURN_RAD_S, TURN_RAD_S)
        bearing = math.atan2(to_home.y_m - pose.y_m, to_home.x_m - pose.x_m)
        off = math.remainder(bearing - pose.heading_rad, math.tau)
        return (0.0, math.copysign(0.6, off)) if abs(off) > 0.4 else (SPEED_M_S, 0.5 * off)

    async def _start_anew(self) -> None:
        """Wait for rest, arm, and set odometry to the truth where a fault may have spoilt it."""
        with contextlib.suppress(CallError):
            await self._robot.client.stop()
        await asyncio.sleep(1.0)
        while self._invariants.mode != "armed":
            with contextlib.suppress(CallError):
                await self._robot.client.arm()
            await asyncio.sleep(0.5)
        pose = self._robot.board.truth(0.0).world_from_base
        await self._robot.client.reset_odometry(pose.x_m, pose.y_m, pose.heading_rad)
        self._invariants.odometry_set()

    # Faults

    async def stop(self) -> None:
        """A plain stop."""
        await self._robot.client.stop()

    async def fall_silent(self) -> None:
        """The client says nothing for longer than the dead-man."""
        await asyncio.sleep(1.2)
        assert self._robot.board.truth(0.0).twist.linear_m_s == 0.0, "still moving after the dead-man"

    async def press_estop(self) -> None:
        """Someone stops the robot in earnest; commands go on, and are refused."""
        await self._robot.client.estop()
        for _ in range(10):
            with contextlib.suppress(CallError):
                await self._robot.client.drive(SPEED_M_S, 0.0)
            await asyncio.sleep(0.1)
        assert self._robot.board.truth(0.0).twist.linear_m_s == 0.0, "moving while stopped"

    async def pull_the_cable(self) -> None:
        """Unplugged for a while: the motors keep their last command, as the firmware has it."""
        self._invariants.encoders_touched()
        self._robot.device.unplug()
        await asyncio.sleep(self._rng.uniform(0.05, 1.0))
        self._robot.device.plug()
        await asyncio.sleep(2.5)

    async def reset_the_board(self) -> None:
        """The board restarts while the wheels may still turn."""
        self._invariants.encoders_touched()
        with contextlib.suppress(CallError):
            await self._robot.client.reset_board()
        await asyncio.sleep(2.5)

    async def make_noise(self) -> None:
        """Garbage between the lines, for a second."""
        for _ in range(20):
            garbage = self._rng.randbytes(self._rng.randrange(1, 80))
            self._robot.device.feed(b"\n" + garbage + b"\n")
            await asyncio.sleep(0.05)

    async def stall_the_reader(self) -> None:
        """The board does not read for a while."""
        transport = self._robot.device.transport
        assert transport is not None
        transport.stall()
        await asyncio.sleep(self._rng.uniform(0.1, 1.0))
        transport.drain()


def soak(minutes: float, seed: int) -> Report:
    """Drive for so many simulated minutes; raises ``AssertionError`` when anything does not hold."""
    report = Report(minutes=minutes)
    settings = load(overrides={"sim.seed": seed, "sim.board.cycle_s": 0.05})

    async def scenario() -> None:
        async with simulated_robot(settings) as robot:
            invariants = Invariants(robot, settings, report)
            driver = Driver(robot, invariants, random.Random(seed))
            watching = asyncio.create_task(invariants.watch())
            await driver.go(minutes / 4)
            before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            driving = asyncio.create_task(driver.go(3 * minutes / 4))
            await asyncio.wait({driving, watching}, return_when=asyncio.FIRST_COMPLETED)
            for task in (driving, watching):
                if task.done():
                    await task
            watching.cancel()
            driving.cancel()
            await asyncio.gather(driving, watching, return_exceptions=True)
            report.faults.update({f"injected: {name}": n for name, n in driver.injected.items()})
            report.resident_growth_mb = (
                resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
            ) / 1024

    run_virtual(scenario())
    assert report.resident_growth_mb < 10, f"memory grew by {report.resident_growth_mb} MB"
    return report


if __name__ == "__main__":
    logs.configure("error")
    print(soak(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1).dump())  # noqa: T201
