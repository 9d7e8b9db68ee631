"""A random driver: it exceeds limits, goes on commanding whatever the answer, and injects faults."""

import asyncio
import contextlib
import math
import random
from collections import Counter
from collections.abc import Awaitable, Callable

from chefbotd.client import CallError, MotionInterrupted
from chefbotd.clock import LoopClock
from chefbotd.core.geometry import Pose2D
from chefbotd.testing.daemon import SimulatedRobot
from tests.fakes.bad_cable import BadCable, CableParameters
from tests.scenarios.instruments import task_count
from tests.scenarios.invariants import Invariants
from tests.scenarios.wires import frozen, rewire, transport_of

PERIOD_S = 0.1
SPEED_M_S, TURN_RAD_S = 0.25, 0.9
TOO_MUCH = 10.0
"""Now and then it asks for so many times as much, for a moment."""

REST_S = 1.5
"""A ramp down, while the sketch may wait a second for an echo."""

SILENT_S = 2.0
"""The dead-man, and a ramp down from the fastest turn."""

BLIND_S = 0.5
"""Longer than the encoders may be silent, and the next look."""

STALLED_S = 2.5
"""The time to find a wheel that stands, and the ramp before it."""

ARMED_AGAIN_S = 10.0
HOME, HOME_M = Pose2D(1.0, 1.0, 0.0), 0.8
"""Farther from there than this the robot turns back: the room has walls."""

Fault = Callable[[], Awaitable[None]]


class RandomDriver:
    """All that it does comes from one seed. ``restarts``: whether the board does so when it is asked to."""

    def __init__(
        self, robot: SimulatedRobot, invariants: Invariants, rng: random.Random, *, restarts: bool
    ) -> None:
        self._robot, self._invariants, self._rng = robot, invariants, rng
        self._restarts = restarts
        self.injected: Counter[str] = Counter()
        self._faults: tuple[Fault, ...] = (
            self.stop,
            self.fall_silent,
            self.press_estop,
            self.arm_at_once,
            self.pull_the_cable,
            self.reset_the_board,
            self.make_noise,
            self.damage_the_line,
            self.stall_the_reader,
            self.mute_the_board,
            self.unplug_an_encoder,
        )

    async def go(self, minutes: float) -> None:
        """Legs of driving with a fault between them, for so long."""
        clock = LoopClock()
        end_s = clock.now_s() + 60 * minutes
        await asyncio.sleep(1.0)
        await self._start_anew()
        tasks = task_count()
        while clock.now_s() < end_s:
            await self._leg()
            fault = self._rng.choice(self._faults)
            self.injected[fault.__name__] += 1
            await fault()
            await self._start_anew()
            left = task_count() - tasks
            assert not left, f"{left} tasks more than at the start, after {fault.__name__}"

    async def _leg(self) -> None:
        """Nothing is wrong, so nothing may be found: but a wall that is driven into does hold wheels up."""
        contacts = self._invariants.contacts
        await self._command(self._rng.uniform(1.0, 6.0), self._somewhere())
        if self._rng.random() < 0.2:
            linear_m_s, angular_rad_s = self._somewhere()
            await self._command(0.5, (TOO_MUCH * linear_m_s, 0.0))
            await self._command(1.0, (0.0, TOO_MUCH * angular_rad_s))
        well = self._invariants.mode == "armed" or self._invariants.contacts > contacts
        assert well, "a fault was found where there is none"

    async def _command(self, seconds: float, twist: tuple[float, float] | None = None) -> None:
        """Go on commanding for so long, whatever is answered."""
        twist = twist or self._somewhere()
        for _ in range(round(seconds / PERIOD_S)):
            with contextlib.suppress(CallError, MotionInterrupted):
                await self._robot.client.drive(*twist)
                self._invariants.commanded()
            await asyncio.sleep(PERIOD_S)

    def _somewhere(self) -> tuple[float, float]:
        """A random twist; towards the start when the robot is far from it."""
        pose, home = self._robot.board.truth(0.0).world_from_base, HOME
        if math.dist((pose.x_m, pose.y_m), (home.x_m, home.y_m)) < HOME_M:
            return self._rng.uniform(-SPEED_M_S, SPEED_M_S), self._rng.uniform(-TURN_RAD_S, TURN_RAD_S)
        bearing = math.atan2(home.y_m - pose.y_m, home.x_m - pose.x_m)
        off = math.remainder(bearing - pose.heading_rad, math.tau)
        return (0.0, math.copysign(0.6, off)) if abs(off) > 0.4 else (SPEED_M_S, 0.5 * off)

    async def _start_anew(self) -> None:
        """Wait for rest, arm, and set odometry to the truth where a fault may have spoilt it."""
        with contextlib.suppress(CallError):
            await self._robot.client.stop()
        await asyncio.sleep(REST_S)
        async with asyncio.timeout(ARMED_AGAIN_S):
            while self._invariants.mode != "armed":
                with contextlib.suppress(CallError):
                    await self._robot.client.arm()
                await asyncio.sleep(0.5)
        pose: Pose2D = self._robot.board.truth(0.0).world_from_base
        await self._robot.client.reset_odometry(pose.x_m, pose.y_m, pose.heading_rad)
        self._invariants.odometry_set()

    # Faults

    async def stop(self) -> None:
        """A plain stop."""
        await self._robot.client.stop()

    async def fall_silent(self) -> None:
        """The client says nothing for longer than the dead-man."""
        await asyncio.sleep(SILENT_S)
        assert self._invariants.told_to_stop, "no stop on the wire after the dead-man"

    async def press_estop(self) -> None:
        """Someone stops the robot in earnest; commands go on, and are refused."""
        await self._robot.client.estop()
        assert self._invariants.told_to_stop, "no stop on the wire after an estop"
        await self._command(1.0)

    async def arm_at_once(self) -> None:
        """Armed again before the last command is old: nothing moves by that."""
        await self._robot.client.estop()
        await self._robot.client.arm()
        await asyncio.sleep(2 * PERIOD_S)
        assert self._invariants.told_to_stop, "moves because it was armed"

    async def pull_the_cable(self) -> None:
        """Unplugged for a while: the motors keep their last command, as the firmware has it. Commands go on."""
        self._invariants.encoders_touched()
        self._robot.device.unplug()
        await self._command(self._rng.uniform(0.1, 1.0))
        self._robot.device.plug()
        await self._command(2.5)
        assert self._invariants.mode == "disarmed", "armed again without an arm"

    async def reset_the_board(self) -> None:
        """The board is asked to restart while the robot drives. Commands go on; one that does not is driven again."""
        self._invariants.encoders_touched()
        self._invariants.deaf(1.5)
        with contextlib.suppress(CallError):
            await self._robot.client.reset_board()
            self._invariants.halted()
        await self._command(4.0)
        assert (self._invariants.mode == "disarmed") is self._restarts, (
            f"{self._invariants.mode} after a reset"
        )

    async def make_noise(self) -> None:
        """Garbage between the lines, for a second."""
        for _ in range(20):
            garbage = self._rng.randbytes(self._rng.randrange(1, 80))
            self._robot.device.feed(b"\n" + garbage + b"\n")
            await asyncio.sleep(0.05)

    async def damage_the_line(self) -> None:
        """One byte in a hundred suffers on its way from the board, while it is driven; then the line is sound."""
        transport = transport_of(self._robot)
        shares = CableParameters(**{self._rng.choice(["flip_share", "drop_share", "double_share"]): 0.01})
        cable, feed = BadCable(shares, self._rng.randrange(1000)), transport.feed
        transport.feed = lambda data: feed(cable.carry(data))  # type: ignore[method-assign]
        self._invariants.encoders_touched()
        await self._command(2.0)
        transport.feed = feed  # type: ignore[method-assign]

    async def stall_the_reader(self) -> None:
        """The board does not read for a while."""
        transport, seconds = transport_of(self._robot), self._rng.uniform(0.1, 1.0)
        self._invariants.deaf(seconds)
        transport.stall()
        await asyncio.sleep(seconds)
        transport.drain()

    async def mute_the_board(self) -> None:
        """Nothing that the board says arrives, for a moment or for long; commands go on."""
        transport, seconds = transport_of(self._robot), self._rng.uniform(0.1, 3.0)
        feed, transport.feed = transport.feed, lambda data: None  # type: ignore[method-assign]
        await self._command(min(seconds, BLIND_S))
        assert seconds < BLIND_S or self._invariants.told_to_stop, "drives without being able to see"
        await self._command(max(0.0, seconds - BLIND_S))
        transport.feed = feed  # type: ignore[method-assign]

    async def unplug_an_encoder(self) -> None:
        """A wheel seems to stand while it is driven: that is found out before long."""
        transport, wheel = transport_of(self._robot), self._rng.randrange(len(self._robot.board.duty))
        feed, driven_s = transport.feed, self._invariants.driven_s
        rewire(self._robot, b"e", frozen(wheel))
        self._invariants.encoders_touched()
        await self._command(4.0, (self._rng.choice([-SPEED_M_S, SPEED_M_S]), 0.0))
        transport.feed = feed  # type: ignore[method-assign]
        driven_s = self._invariants.driven_s - driven_s
        assert driven_s < STALLED_S, f"driven for {driven_s:.1f} s with encoder {wheel} unplugged"
