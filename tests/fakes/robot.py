"""A robot behind the command socket that remembers what it was asked, and refuses on demand."""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

from chefbotd.core.commands import Allowed, RefusalKind, Refused
from chefbotd.core.events import StatsSampled
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.motion.pid import PidParameters

WHEELS = ("left", "right")

STATS = StatsSampled(
    stamp_s=1.0,
    uptime_s=60.0,
    frames={"encoders": 100},
    refused={"noise": 2},
    lines_out=50,
    setpoints_replaced=1,
    link_opens=1,
    board_restarts=0,
    encoder_readings_refused=0,
    control_steps=99,
    bus_dropped={},
    clients=1,
    clients_refused={},
    handler_faults={},
    telemetry_dropped=0,
    loop_lag_s=0.001,
    board_clock_skew_ppm=None,
    board_clock_jitter_s=None,
)


class FakeRobot:
    """``calls`` lists every command; ``answer`` is raised by every one of them, if set."""

    command_timeout_s = 0.5
    let_go_s = 1.0
    default_source = "teleop"
    description: str | None = "<robot name='fake'/>"
    sources = ("safety", "teleop", "navigation")

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.resumed: list[str] = []
        self.answer: Exception | None = None
        self.gains = {name: PidParameters(kp=400.0, ki=100.0, output_limit=1023.0) for name in WHEELS}

    def _record(self, *call: object) -> None:
        if self.answer is not None:
            raise self.answer
        self.calls.append(call)

    def drive(self, source: str, twist: Twist2D) -> Allowed[Twist2D]:
        """Remember it; it goes 1 m/s at most."""
        self._record("drive", source, twist)
        if abs(twist.linear_m_s) <= 1.0:
            return Allowed(twist)
        return Allowed(Twist2D(math.copysign(1.0, twist.linear_m_s), twist.angular_rad_s), "limits.linear")

    def set_wheel_velocities(
        self, source: str, velocity_rad_s: Mapping[str, float]
    ) -> Allowed[Mapping[str, float]]:
        """Remember it; only the two wheels of ``WHEELS`` are known, and they turn at 10 rad/s at most."""
        self._record("set_wheel_velocities", source, dict(velocity_rad_s))
        for wheel in velocity_rad_s:
            if wheel not in WHEELS:
                raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel {wheel}")
        fastest = max(map(abs, velocity_rad_s.values()))
        share = 1.0 if fastest <= 10.0 else 10.0 / fastest
        slowed = {name: velocity_rad_s.get(name, 0.0) * share for name in WHEELS}
        return Allowed(slowed, None if share == 1.0 else "drive.max_rim_speed_m_s")

    def release(self, source: str) -> None:
        """Remember it."""
        self._record("release", source)

    def stop(self, by: str, excluded: Collection[str] = ()) -> None:
        """Remember it."""
        self._record("stop")

    def resume(self, sources: Collection[str]) -> None:
        """Remember whose driver asks anew, apart from the commands."""
        self.resumed.extend(sources)

    def estop(self, reason: str) -> None:
        """Remember it."""
        self._record("estop", reason)

    def arm(self) -> None:
        """Remember it."""
        self._record("arm")

    def pid(self) -> Mapping[str, PidParameters]:
        """The gains as last set."""
        self._record("pid")
        return self.gains

    def set_pid(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change them; only the two wheels of ``WHEELS`` are known."""
        self._record("set_pid", wheel, dict(changes))
        if wheel not in (*WHEELS, "all"):
            raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel {wheel}")
        for name in WHEELS:
            if wheel in (name, "all"):
                self.gains[name] = self.gains[name].model_copy(update=changes)
        return self.gains

    def undo_pid(self) -> Mapping[str, PidParameters]:
        """Remember it; the gains as last set."""
        self._record("undo_pid")
        return self.gains

    def set_odometry(self, pose: Pose2D) -> None:
        """Remember it."""
        self._record("set_odometry", pose)

    def reset_board(self) -> None:
        """Remember it."""
        self._record("reset_board")

    def stats(self) -> StatsSampled:
        """The same ones always, but for a count of commands."""
        self._record("stats")
        return replace(STATS, control_steps=len(self.calls))
