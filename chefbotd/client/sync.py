"""The client without asyncio, for scripts, notebooks and first programs: same names, plain calls.

    with SyncClient.connect() as robot:
        robot.wait_until_armed()
        robot.drive_for(2.0, linear_m_s=0.2)
        print(robot.get_state().odometry.x_m)

It runs the asyncio client in a thread of its own.
"""

from __future__ import annotations

import ssl
from collections import Counter
from collections.abc import Coroutine, Iterable, Mapping
from contextlib import AsyncExitStack
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar, Unpack

from chefbotd.client.background import BackgroundLoop
from chefbotd.client.client import Client
from chefbotd.client.handshake import Hello
from chefbotd.client.methods import Gains
from chefbotd.client.subscription import SubscribeOptions, Subscription
from chefbotd.client.sync_maps import SyncMaps
from chefbotd.client.sync_navigation import SyncNavigation
from chefbotd.client.sync_recording import SyncRecording
from chefbotd.client.sync_subscription import SyncSubscription
from chefbotd.client.sync_topics import SyncTopics
from chefbotd.client.wire import ProgressListener

if TYPE_CHECKING:
    from chefbotd.client import models
    from chefbotd.client.models import StatsData
    from chefbotd.client.state import State
    from chefbotd.motion.pid import PidParameters

T = TypeVar("T")


class SyncClient(SyncMaps, SyncNavigation, SyncRecording, SyncTopics):
    """A connected daemon; made by ``connect``. Every method is ``Client``'s of the same name, and raises the same.

    It may be used from several threads. Close it, or use it as ``with SyncClient.connect() as robot``.
    """

    def __init__(self, loop: BackgroundLoop, client: Client, stack: AsyncExitStack) -> None:
        self._loop, self._client, self._stack = loop, client, stack

    @classmethod
    def connect(
        cls,
        host: str = "127.0.0.1",
        port: int = 7333,
        *,
        token: str | None = None,
        tls: ssl.SSLContext | None = None,
        name: str | None = None,
        timeout_s: float = 5.0,
        reconnect: bool = False,
    ) -> Self:
        """Connect at once; the parameters are those of ``Client.connect``."""
        loop, stack = BackgroundLoop(), AsyncExitStack()

        async def enter() -> Client:
            meeting = Client.connect(
                host, port, token=token, tls=tls, name=name, timeout_s=timeout_s, reconnect=reconnect
            )
            return await stack.enter_async_context(meeting)

        try:
            return cls(loop, loop.run(enter()), stack)
        except BaseException:
            loop.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect: the daemon withdraws what this client drove with. Doing it twice is harmless."""
        if not self._loop.closed:
            try:
                self._loop.run(self._stack.aclose())
            finally:
                self._loop.close()

    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        return self._loop.run(work)

    @property
    def hello(self) -> Hello:
        """The daemon's latest greeting."""
        return self._client.hello

    @property
    def connected(self) -> bool:
        """Whether the connection stands."""
        return self._client.connected and not self._loop.closed

    @property
    def dropped(self) -> Counter[str]:
        """Events that the daemon gave up for this connection, by topic."""
        return self._client.dropped

    def call(
        self, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> dict[str, Any]:
        """Any method by its name: the answer's ``result`` as it came. ``on_progress`` is called in another thread."""
        return self._run(self._client.call(method, on_progress=on_progress, **params))

    def _subscription(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[Any]:
        async def make() -> Subscription[Any]:
            return self._client.subscribe(topics, **options)

        return SyncSubscription(self._loop, self._run(make()))

    def drive(self, linear_m_s: float, angular_rad_s: float, source: str | None = None) -> models.Driven:
        """Ask for a velocity (m/s forward, rad/s CCW); it holds for the dead-man time, so repeat it."""
        return self._run(self._client.drive(linear_m_s, angular_rad_s, source))

    def drive_for(
        self,
        seconds: float,
        linear_m_s: float = 0.0,
        angular_rad_s: float = 0.0,
        source: str | None = None,
    ) -> models.Driven:
        """Drive for some seconds, then brake until the robot stands; brakes on Ctrl-C, too."""
        return self._run(self._client.drive_for(seconds, linear_m_s, angular_rad_s, source))

    def set_wheel_velocities(
        self, velocity_rad_s: Mapping[str, float], source: str | None = None
    ) -> models.WheelsDriven:
        """Ask for a speed of each wheel by name, in rad/s; the others stand. Repeat it."""
        return self._run(self._client.set_wheel_velocities(velocity_rad_s, source))

    def stop(self) -> dict[str, str]:
        """Bring the robot to rest within the deceleration limit, whoever drives it; by source, who did."""
        return self._run(self._client.stop())

    def estop(self, reason: str | None = None) -> None:
        """Stop the motors at once, and until ``arm``."""
        self._run(self._client.estop(reason))

    def arm(self) -> None:
        """Allow motion again after an emergency stop or a fault."""
        self._run(self._client.arm())

    def set_client_name(self, client: str) -> None:
        """Say what this client is called where others see who drives."""
        self._run(self._client.set_client_name(client))

    def authenticate(self, token: str) -> models.Known:
        """Show a token; ``connect(token=...)`` does so by itself."""
        return self._run(self._client.authenticate(token))

    def take_control(self, source: str | None = None) -> str | None:
        """Have a source of commands for ourselves; who had it until now, if another did."""
        return self._run(self._client.take_control(source))

    def release_control(self) -> list[str]:
        """Give back every source that we have, and name them."""
        return self._run(self._client.release_control())

    def get_state(self) -> State:
        """The link, the safety, and the latest value of each topic with its age."""
        return self._run(self._client.get_state())

    def wait_until_armed(self, timeout_s: float = 10.0) -> State:
        """Wait until the robot may move; raises ``CallTimeout`` that says what is missing."""
        return self._run(self._client.wait_until_armed(timeout_s))

    def wait_until_connected(self, timeout_s: float = 10.0) -> None:
        """Wait for the connection to stand again, with ``reconnect``."""
        self._run(self._client.wait_until_connected(timeout_s))

    def get_stats(self) -> StatsData:
        """The daemon's counters, as in the topic ``stats``."""
        return self._run(self._client.get_stats())

    def get_description(self) -> str | None:
        """The robot's links and joints as a URDF document; None where the configuration names none."""
        return self._run(self._client.get_description())

    def describe(self) -> models.Description:
        """Methods, topics and error kinds with their JSON Schemas."""
        return self._run(self._client.describe())

    def ping(self) -> models.Pong:
        """Whether the daemon answers; ``stamp_s`` is its monotonic clock."""
        return self._run(self._client.ping())

    def get_pid(self) -> dict[str, PidParameters]:
        """The gains by wheel name."""
        return self._run(self._client.get_pid())

    def set_pid(self, wheel: str = "all", **changes: Unpack[Gains]) -> dict[str, PidParameters]:
        """Change some gains of a wheel, or of all; what every wheel now has."""
        return self._run(self._client.set_pid(wheel, **changes))

    def undo_pid(self) -> dict[str, PidParameters]:
        """Take the latest change of gains back; what every wheel now has."""
        return self._run(self._client.undo_pid())

    def reset_odometry(self, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        """Say where the robot stands in ``odom``."""
        self._run(self._client.reset_odometry(x_m, y_m, heading_rad))

    def reset_board(self) -> None:
        """Restart the board."""
        self._run(self._client.reset_board())

    def start_mapping(self, name: str | None = None, *, unfinished: bool = False) -> models.MappingResult:
        """Begin a map, or go on with a saved one, or with the one that was never finished."""
        return self._run(self._client.start_mapping(name, unfinished=unfinished))

    def pause_mapping(self) -> models.MappingResult:
        """Add nothing to the map until ``start_mapping`` is called."""
        return self._run(self._client.pause_mapping())

    def finish_mapping(self, name: str, *, on_progress: ProgressListener | None = None) -> models.MapSaved:
        """Match all scans once more and save the map. ``on_progress`` is called in another thread."""
        return self._run(self._client.finish_mapping(name, on_progress=on_progress))

    def set_pose(self, x_m: float, y_m: float, heading_rad: float = 0.0) -> models.LocalizationResult:
        """Say about where the robot is in the map in use."""
        return self._run(self._client.set_pose(x_m, y_m, heading_rad))

    def localize(self) -> models.LocalizationResult:
        """Have the robot search the whole map for where it is."""
        return self._run(self._client.localize())

    def discard_mapping(self) -> models.MappingResult:
        """Forget the map that is being made, or that was never finished; saved maps stay."""
        return self._run(self._client.discard_mapping())
