"""The methods of the client that do more than ask: written by hand. The others are in ``generated``.

A method of the socket that has one here gets none there.
"""

from __future__ import annotations

import asyncio
import contextlib
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from chefbotd.client.errors import CallError, CallTimeout, ConnectionLost, MotionInterrupted
from chefbotd.client.generated import GeneratedMethods
from chefbotd.client.handshake import DaemonGreeting
from chefbotd.client.sleep_watch import SleepWatch

if TYPE_CHECKING:
    from chefbotd.client import models
    from chefbotd.client.state import State
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


class Methods(GeneratedMethods):
    """The methods of the robot itself."""

    _sleep_watch: SleepWatch

    @property
    @abstractmethod
    def hello(self) -> DaemonGreeting:
        """The daemon's latest greeting."""

    async def drive(
        self,
        linear_m_s: float,
        angular_rad_s: float,
        source: str | None = None,
        *,
        if_stop_number: int | None = None,
    ) -> models.Driven:
        """Drive at this velocity until the command is replaced or too old; repeat it to keep moving.

        It is too old after the dead-man time (``hello.command_timeout_s``: 0.5 s, KHAN 0.25 s). Without ``source`` it is
        one of the robot's default source. With ``if_stop_number`` it is refused as ``stopped_since`` where the robot was
        stopped after this was its number. The answer is what the limits allow of it.

        Raises:
            MotionInterrupted: this program did not run for longer than that since an earlier command to move. Nothing
                was sent. The next call drives.
        """
        with self._watched_motion(moves=linear_m_s != 0.0 or angular_rad_s != 0.0):
            driven: models.Driven = await self._ask(
                "Driven",
                "drive",
                linear_m_s=linear_m_s,
                angular_rad_s=angular_rad_s,
                source=source,
                if_stop_number=if_stop_number,
            )
        return driven

    @contextlib.contextmanager
    def _watched_motion(self, *, moves: bool) -> Iterator[None]:
        """Around a command. Raises ``MotionInterrupted`` if the motion that it belongs to is over.

        What is refused is no motion.
        """
        self._check_motion(moves=moves)
        try:
            yield
        except CallError:
            self._sleep_watch.stop()
            raise

    def _check_motion(self, *, moves: bool) -> None:
        """A command is about to be sent: raise ``MotionInterrupted`` if the motion that it belongs to is over."""
        slept_s, longest_s = self._sleep_watch.slept_s(), self.hello.command_timeout_s
        if not moves or slept_s > longest_s:
            self._sleep_watch.stop()
        if moves and slept_s > longest_s:
            raise MotionInterrupted(
                f"this program did not run for {slept_s:.1f} s, and the robot obeys a command for {longest_s:g} s: "
                "it has braked, and the motion is over"
            )
        if moves:
            self._sleep_watch.renew()

    async def drive_for(
        self,
        seconds: float,
        linear_m_s: float = 0.0,
        angular_rad_s: float = 0.0,
        source: str | None = None,
    ) -> models.Driven:
        """Drive for ``seconds`` by repeating ``drive`` within the dead-man time, then brake and wait for standstill.

        The robot also brakes after an error or a cancellation. ``MotionInterrupted`` is one: the program slept.
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
        self,
        velocity_rad_s: Mapping[str, float],
        source: str | None = None,
        *,
        if_stop_number: int | None = None,
    ) -> models.WheelSpeedsSet:
        """Command wheel speeds by wheel name, in rad/s. Other wheels stand. It expires as ``drive`` does."""
        names, velocities = list(velocity_rad_s), list(velocity_rad_s.values())
        with self._watched_motion(moves=any(velocities)):
            driven: models.WheelSpeedsSet = await self._ask(
                "WheelSpeedsSet",
                "set_wheel_velocities",
                name=names,
                velocity_rad_s=velocities,
                source=source,
                if_stop_number=if_stop_number,
            )
        return driven

    async def stop(self) -> dict[str, str]:
        """Brake the robot to standstill, whoever drives it. Returns the name of each source's driver.

        Other clients' commands are refused until they pause. Our own next ``drive`` moves the robot again.
        """
        drivers: dict[str, str] = (await self.call("stop")).get("drivers", {})
        return drivers

    async def estop(self, reason: str | None = None) -> None:
        """Stop the motors at once and keep them stopped until ``arm``. A long ``reason`` is cut."""
        await self._ask(None, "estop", reason=None if reason is None else reason[:MAX_REASON_CHARACTERS])

    async def take_control(self, source: str | None = None) -> str | None:
        """Take exclusive control of a source (default: the robot's). Returns the client that had it before, if any."""
        result: models.ControlTaken = await self._ask("ControlTaken", "take_control", source=source)
        return result.taken_from

    async def release_control(self) -> list[str]:
        """Release all sources that we control, and withdraw our commands. Returns the names of the sources."""
        released: models.Released = await self._ask("Released", "release_control")
        return released.sources

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

    async def get_description(self) -> str | None:
        """The robot's links and joints as a URDF document; None where the configuration names none."""
        description: models.RobotDescription = await self._ask("RobotDescription", "get_description")
        return description.urdf

    async def get_pid(self) -> dict[str, PidParameters]:
        """The gains by wheel name."""
        return await self._gains("get_pid")

    async def set_pid(self, wheel: str = "all", **changes: Unpack[Gains]) -> dict[str, PidParameters]:
        """Change some gains of one wheel or of all. Returns the gains of every wheel."""
        return await self._gains("set_pid", wheel=wheel, **changes)

    async def undo_pid(self) -> dict[str, PidParameters]:
        """Undo the latest change of gains, whoever made it. Returns the gains of every wheel."""
        return await self._gains("undo_pid")

    async def _gains(self, method: str, **params: Any) -> dict[str, PidParameters]:
        answer: Any = await self._ask("Wheels", method, **params)
        gains: dict[str, PidParameters] = answer.wheels
        return gains


def _missing_to_move(state: State) -> str:
    if state.link.state != "up":
        return f"the link is down: {state.link.reason}"
    if not state.safety.armed:
        return f"it is {state.safety.mode}: {state.safety.reason}"
    return "" if "odometry" in state.topics else "no odometry yet"
