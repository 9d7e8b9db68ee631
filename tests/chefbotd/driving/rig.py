"""A control loop on a virtual clock, with a board that the test plays."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import EncodersCounted, LinkOpened, SafetyChanged, WheelsDriven, WheelsMeasured
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.safety_supervisor import SafetySupervisor
from chefbotd.driving.service import DriveService
from chefbotd.driving.wheel_reader import WheelReader
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.process.latch_file import LatchFile
from chefbotd.safety.gate import Rearm, SafetyParameters
from chefbotd.safety.watchdog import ControlParameters, WatchdogParameters

CHASSIS = ChassisParameters.model_validate(
    {
        "track_width_m": 0.3,
        "wheels": [
            {"name": "left_wheel", "side": "left", "radius_m": 0.05},
            {"name": "right_wheel", "side": "right", "radius_m": 0.05},
        ],
    }
)
LIMITS = MotionLimits.model_validate(
    {
        "linear": {"max_forward_m_s": 1.0, "acceleration_m_s2": 1.0},
        "angular": {"max_left_rad_s": 5.0, "acceleration_rad_s2": 5.0},
    }
)
GAINS = PidParameters(kp=0.0, ki=0.0, ks=40.0, kv=1000.0, output_limit=1023.0)
AHEAD = Twist2D(0.2, 0.0)
FULL_DUTY = (240, 240)  # 40 + 1000 * 0.2


class Rig:
    """A control loop with a wire that remembers, fed by hand. Feedforward only, so that duties can be computed."""

    def __init__(
        self, rearm: Rearm = Rearm.MANUAL, latch: Path | None = None, chassis: ChassisParameters = CHASSIS
    ) -> None:
        self.bus, self.clock = Bus(), LoopClock()
        self.written: list[tuple[float, tuple[int, ...]]] = []
        self.start_s = self.clock.now_s()
        self.service = DriveService(
            self.bus,
            self.clock,
            lambda duty: self.written.append((round(self.elapsed_s, 6), duty)),
            Drive(
                DriveParameters(max_rim_speed_m_s=0.5, max_duty=1023),
                chassis,
                LIMITS,
                (GAINS,) * len(chassis.wheels),
            ),
            SafetySupervisor(
                self.bus,
                self.clock,
                SafetyParameters(rearm=rearm),
                mounts={"front": Pose2D(0.15)},
                latch=LatchFile(latch),
                motors=MotorWatch(SafetyParameters(rearm=rearm), chassis, 1000),
            ),
            reader=WheelReader(
                chassis,
                EncoderParameters(counts_per_turn=1000, max_speed_rad_s=20.0, velocity_window=2),
                SameSideParameters(),
            ),
            wheel_names=tuple(wheel.name for wheel in chassis.wheels),
            control=ControlParameters(watch_period_s=0.02),
            watchdog=WatchdogParameters(),
        )
        self.safety = self.bus.subscribe(SafetyChanged)
        self.wheels = self.bus.subscribe(WheelsMeasured, WheelsDriven)
        self.task = asyncio.create_task(self.service.run())

    @property
    def elapsed_s(self) -> float:
        """Seconds since the rig was built."""
        return self.clock.now_s() - self.start_s

    @property
    def duty(self) -> tuple[int, ...]:
        """The last duty on the wire."""
        return self.written[-1][1]

    async def open_link(self) -> None:
        """The board is there."""
        self.bus.publish(LinkOpened(self.clock.now_s(), "fake"))
        await asyncio.sleep(0)

    async def frames(self, seconds: float, *, counts: tuple[int, int] = (0, 0)) -> None:
        """Encoder frames every 10 ms, always the same counts."""
        for _ in range(round(seconds / 0.01)):
            await asyncio.sleep(0.01)
            self.bus.publish(EncodersCounted(*[self.clock.now_s()] * 3, counts))
            await asyncio.sleep(0)

    def arm(self) -> None:
        """As a client does that then drives: it knows of what it clears."""
        self.service.arm()
        self.service.acknowledge_stops(0)

    async def drive_for(self, seconds: float) -> None:
        """Command and frames together, both every 10 ms."""
        for _ in range(round(seconds / 0.01)):
            self.service.command("teleop", AHEAD)
            await self.frames(0.01)

    def modes(self) -> list[tuple[str, str | None]]:
        """Safety events since the last call, as mode and source."""
        events = [self.safety.take_event() for _ in range(len(self.safety))]
        return [(event.mode, event.source) for event in events]


def on_rig(
    scenario: Callable[[Rig], Awaitable[None]],
    rearm: Rearm = Rearm.MANUAL,
    latch: Path | None = None,
    chassis: ChassisParameters = CHASSIS,
) -> None:
    """Run a scenario with the link open, on the virtual clock."""

    async def run() -> None:
        rig = Rig(rearm, latch, chassis)
        await asyncio.sleep(0)
        await rig.open_link()
        await scenario(rig)
        rig.task.cancel()
        await asyncio.gather(rig.task, return_exceptions=True)

    run_virtual(run())
