"""One Python method per method of the command socket.

Importing the result models takes about 0.3 s. Each method imports its own model before it calls, so that ``stop`` and
``estop`` of a program that has just started do not wait for models, and a robot never drives while they load.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from chefbotd.client.caller import Caller, given, ignore_progress
from chefbotd.client.errors import CallError, CallTimeout, ConnectionLost
from chefbotd.client.parsing import parse

if TYPE_CHECKING:
    from chefbotd.client import models
    from chefbotd.client.models import StatsData
    from chefbotd.client.state import State
    from chefbotd.client.wire import ProgressListener
    from chefbotd.motion.pid import PidParameters

MAX_REASON_CHARACTERS = 200  # more is cut by the daemon; a line that is too long would end the connection
DRIVE_PERIOD_S = 0.05
"""Several times within any dead-man: KHAN's is 0.25 s."""

POLL_PERIOD_S = 0.05
STANDING_M_S, STANDING_RAD_S = 0.002, 0.01
SETTLING_PATIENCE_S = 3.0


class Gains(TypedDict, total=False):
    """The gains that ``set_pid`` can change; see ``PidParameters`` for what each does and its unit."""

    kp: float
    ki: float
    kd: float
    ks: float
    kv: float
    ka: float
    output_limit: float
    integral_limit: float | None
    deadband: float
    derivative_filter_s: float
    back_calculation_s: float | None
    conditional_integration: bool


class Methods(Caller):
    """The methods of the robot itself."""

    # motion

    async def drive(
        self, linear_m_s: float, angular_rad_s: float, source: str | None = None
    ) -> models.Driven:
        """Command a velocity: forward in m/s, turning in rad/s (CCW positive). Returns what the limits allow.

        The command expires after the daemon's dead-man time (0.5 s, KHAN 0.25 s): repeat it, or use ``drive_for``.
        Without ``source`` the robot's default source is used.
        """
        from chefbotd.client import models

        asked = given(linear_m_s=linear_m_s, angular_rad_s=angular_rad_s, source=source)
        return parse(models.Driven, await self.call("drive", **asked))

    async def drive_for(
        self,
        seconds: float,
        linear_m_s: float = 0.0,
        angular_rad_s: float = 0.0,
        source: str | None = None,
    ) -> models.Driven:
        """Drive for ``seconds`` by repeating ``drive`` within the dead-man time, then brake and wait for standstill.

        The robot also brakes after an error or a cancellation.
        """
        loop = asyncio.get_running_loop()
        ends_s = loop.time() + seconds
        try:
            allowed = await self.drive(linear_m_s, angular_rad_s, source)
            while (left_s := ends_s - loop.time()) > 0:
                await asyncio.sleep(min(DRIVE_PERIOD_S, left_s))
                allowed = await self.drive(linear_m_s, angular_rad_s, source)
        finally:
            await self._brake(source)
        await self._until_standing()
        return allowed

    async def _brake(self, source: str | None) -> None:
        """Command zero for our own source only. A lost connection or a refusal is ignored: we do not drive then."""
        with contextlib.suppress(CallError, ConnectionLost):
            await self.drive(0.0, 0.0, source)

    async def _until_standing(self) -> None:
        loop = asyncio.get_running_loop()
        ends_s = loop.time() + SETTLING_PATIENCE_S
        while loop.time() < ends_s:
            await asyncio.sleep(POLL_PERIOD_S)
            odometry = (await self.get_state()).odometry
            if abs(odometry.linear_m_s) < STANDING_M_S and abs(odometry.angular_rad_s) < STANDING_RAD_S:
                return

    async def set_wheel_velocities(
        self, velocity_rad_s: Mapping[str, float], source: str | None = None
    ) -> models.WheelsDriven:
        """Command wheel speeds by wheel name, in rad/s. Other wheels stand. It expires as ``drive`` does."""
        from chefbotd.client import models

        names, velocities = list(velocity_rad_s), list(velocity_rad_s.values())
        asked = given(name=names, velocity_rad_s=velocities, source=source)
        return parse(models.WheelsDriven, await self.call("set_wheel_velocities", **asked))

    async def stop(self) -> dict[str, str]:
        """Brake the robot to standstill, whoever drives it. Returns the name of each source's driver.

        Other clients' commands are refused until they pause. Our own next ``drive`` moves the robot again.
        """
        drivers: dict[str, str] = (await self.call("stop")).get("drivers", {})
        return drivers

    async def estop(self, reason: str | None = None) -> None:
        """Stop the motors at once and keep them stopped until ``arm``. A long ``reason`` is cut."""
        told = None if reason is None else reason[:MAX_REASON_CHARACTERS]
        await self.call("estop", **given(reason=told))

    async def arm(self, latch: int | None = None) -> None:
        """Allow motion again after an emergency stop or a fault.

        ``latch``, from the topic ``safety``, names what is to be cleared: what came after it is not.
        """
        told: dict[str, Any] = {} if latch is None else {"latch": latch}
        await self.call("arm", **told)

    # who drives

    async def set_client_name(self, client: str) -> None:
        """Set the name under which other clients see this one: 1 to 64 characters."""
        await self.call("set_client_name", client=client)

    async def authenticate(self, token: str) -> models.Known:
        """Authenticate with a token; ``connect(token=...)`` does this already."""
        from chefbotd.client import models

        return parse(models.Known, await self.call("authenticate", token=token))

    async def take_control(self, source: str | None = None) -> str | None:
        """Take exclusive control of a source (default: the robot's). Returns the client that had it before, if any."""
        from chefbotd.client import models

        return parse(models.Taken, await self.call("take_control", **given(source=source))).taken_from

    async def release_control(self) -> list[str]:
        """Release all sources that we control, and withdraw our commands. Returns the names of the sources."""
        from chefbotd.client import models

        return parse(models.Released, await self.call("release_control")).sources

    # state

    async def get_state(self) -> State:
        """The link, the safety, and the latest value of each topic with its age."""
        from chefbotd.client.state import parse_state

        return parse_state(await self.call("get_state"))

    async def wait_until_armed(self, timeout_s: float = 10.0) -> State:
        """Wait until the robot can move: the board is connected, odometry has been reported, and the robot is armed.

        It does not arm the robot: after an emergency stop a person has to check it and call ``arm``.

        Raises:
            CallTimeout: not within ``timeout_s`` seconds; the message says what is missing.
        """
        missing = "no answer yet"
        try:
            async with asyncio.timeout(timeout_s):
                while missing:
                    state = await self.get_state()
                    missing = _missing_to_move(state)
                    if missing:
                        await asyncio.sleep(POLL_PERIOD_S)
        except TimeoutError:
            raise CallTimeout(f"the robot was not ready to move within {timeout_s:g} s: {missing}") from None
        return state

    async def get_stats(self) -> StatsData:
        """The daemon's counters, as in the topic ``stats``."""
        from chefbotd.client.models import StatsData

        return parse(StatsData, await self.call("get_stats"))

    async def get_description(self) -> str | None:
        """The robot's links and joints as a URDF document; None where the configuration names none."""
        from chefbotd.client import models

        return parse(models.RobotDescription, await self.call("get_description")).urdf

    async def describe(self) -> models.Description:
        """Methods, topics and error kinds with their JSON Schemas."""
        from chefbotd.client import models

        return parse(models.Description, await self.call("describe"))

    async def ping(self) -> models.Pong:
        """Check that the daemon answers. ``stamp_s`` is its monotonic clock."""
        from chefbotd.client import models

        return parse(models.Pong, await self.call("ping"))

    # tuning and resets

    async def get_pid(self) -> dict[str, PidParameters]:
        """The gains by wheel name."""
        return _gains(await self.call("get_pid"))

    async def set_pid(self, wheel: str = "all", **changes: Unpack[Gains]) -> dict[str, PidParameters]:
        """Change some gains of one wheel or of all. Returns the gains of every wheel."""
        return _gains(await self.call("set_pid", wheel=wheel, **changes))

    async def undo_pid(self) -> dict[str, PidParameters]:
        """Undo the latest change of gains, whoever made it. Returns the gains of every wheel."""
        return _gains(await self.call("undo_pid"))

    async def reset_odometry(self, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        """Set the robot's pose in ``odom``."""
        await self.call("reset_odometry", x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    async def reset_board(self) -> None:
        """Restart the board."""
        await self.call("reset_board")

    # localization and mapping, where the robot has a lidar

    async def set_pose(self, x_m: float, y_m: float, heading_rad: float = 0.0) -> models.LocalizationResult:
        """Say about where the robot is in the map in use; the next scans confirm it, or it searches."""
        from chefbotd.client import models

        answer = await self.call("set_pose", x_m=x_m, y_m=y_m, heading_rad=heading_rad)
        return parse(models.LocalizationResult, answer)

    async def localize(
        self, *, turn: bool = False, on_progress: ProgressListener | None = None
    ) -> models.LocalizationResult:
        """Have the robot search the whole map for where it is; the topic ``localization`` tells how that goes.

        With ``turn`` it turns once on the spot, where looking is not enough: this waits for the end, and giving it up
        ends the turn.
        """
        from chefbotd.client import models

        if not turn:
            return parse(models.LocalizationResult, await self.call("localize"))
        answer = await self.call("localize", on_progress=on_progress or ignore_progress, turn=True)
        return parse(models.LocalizationResult, answer)

    async def start_mapping(
        self, name: str | None = None, *, unfinished: bool = False
    ) -> models.MappingResult:
        """Begin a map; with a ``name`` go on with that saved one, ``unfinished``: with the one never finished."""
        from chefbotd.client import models

        answer = await self.call("start_mapping", **given(name=name), unfinished=unfinished)
        return parse(models.MappingResult, answer)

    async def pause_mapping(self) -> models.MappingResult:
        """Add nothing to the map until ``start_mapping`` is called."""
        from chefbotd.client import models

        return parse(models.MappingResult, await self.call("pause_mapping"))

    async def finish_mapping(
        self, name: str, *, on_progress: ProgressListener | None = None
    ) -> models.MapSaved:
        """Match all scans once more and save the map; it takes seconds, for a building minutes."""
        from chefbotd.client import models

        answer = await self.call("finish_mapping", name=name, on_progress=on_progress or ignore_progress)
        return parse(models.MapSaved, answer)

    async def discard_mapping(self) -> models.MappingResult:
        """Forget the map that is being made, or that was never finished; saved maps stay."""
        from chefbotd.client import models

        return parse(models.MappingResult, await self.call("discard_mapping"))


def _missing_to_move(state: State) -> str:
    if state.link.state != "up":
        return f"the link is down: {state.link.reason}"
    if not state.safety.armed:
        return f"it is {state.safety.mode}: {state.safety.reason}"
    return "" if "odometry" in state.topics else "no odometry yet"


def _gains(answer: dict[str, Any]) -> dict[str, PidParameters]:
    from chefbotd.client import models

    return parse(models.Wheels, answer).wheels
