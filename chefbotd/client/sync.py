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
from collections.abc import Callable, Coroutine, Iterable
from contextlib import AsyncExitStack
from functools import wraps
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, TypeVar, Unpack

from chefbotd.client.background import BackgroundLoop
from chefbotd.client.client import Client
from chefbotd.client.errors import ConnectionLost
from chefbotd.client.handshake import Hello
from chefbotd.client.subscription import SubscribeOptions, Subscription
from chefbotd.client.sync_subscription import SyncSubscription
from chefbotd.client.topics import SyncTopics

P = ParamSpec("P")
T = TypeVar("T")


def blocking(
    method: Callable[Concatenate[Client, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[SyncClient, P], T]:
    """A method of the asyncio client as a plain one, which returns when that one has ended."""

    @wraps(method)
    def call(self: SyncClient, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self._loop.run(method(self._client, *args, **kwargs))

    return call


class SyncClient(SyncTopics):
    """A connected daemon; made by ``connect``. Every method is ``Client``'s of the same name, and raises the same.

    ``on_progress`` is called in another thread. Ctrl-C cancels what is waited for: ``drive_for`` brakes, goals end.
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
            except ConnectionLost:
                if not self._loop.closed:  # else another thread was first
                    raise
            finally:
                self._loop.close()

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

    def _subscription(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[Any]:
        async def make() -> Subscription[Any]:
            return self._client.subscribe(topics, **options)

        return SyncSubscription(self._loop, self._loop.run(make()))

    call = blocking(Client.call)

    drive = blocking(Client.drive)
    drive_for = blocking(Client.drive_for)
    set_wheel_velocities = blocking(Client.set_wheel_velocities)
    stop = blocking(Client.stop)
    estop = blocking(Client.estop)
    arm = blocking(Client.arm)
    set_client_name = blocking(Client.set_client_name)
    authenticate = blocking(Client.authenticate)
    take_control = blocking(Client.take_control)
    release_control = blocking(Client.release_control)
    get_state = blocking(Client.get_state)
    wait_until_armed = blocking(Client.wait_until_armed)
    wait_until_connected = blocking(Client.wait_until_connected)
    get_stats = blocking(Client.get_stats)
    get_description = blocking(Client.get_description)
    describe = blocking(Client.describe)
    ping = blocking(Client.ping)
    get_pid = blocking(Client.get_pid)
    set_pid = blocking(Client.set_pid)
    undo_pid = blocking(Client.undo_pid)
    reset_odometry = blocking(Client.reset_odometry)
    reset_board = blocking(Client.reset_board)

    set_pose = blocking(Client.set_pose)
    localize = blocking(Client.localize)
    start_mapping = blocking(Client.start_mapping)
    pause_mapping = blocking(Client.pause_mapping)
    finish_mapping = blocking(Client.finish_mapping)
    discard_mapping = blocking(Client.discard_mapping)

    list_maps = blocking(Client.list_maps)
    load_map = blocking(Client.load_map)
    get_map = blocking(Client.get_map)
    import_map = blocking(Client.import_map)
    rename_map = blocking(Client.rename_map)
    delete_map = blocking(Client.delete_map)
    save_place = blocking(Client.save_place)
    list_places = blocking(Client.list_places)
    delete_place = blocking(Client.delete_place)

    navigate_to = blocking(Client.navigate_to)
    follow_waypoints = blocking(Client.follow_waypoints)
    go_home = blocking(Client.go_home)
    dock = blocking(Client.dock)
    plan_to = blocking(Client.plan_to)
    cancel_navigation = blocking(Client.cancel_navigation)
    pause_navigation = blocking(Client.pause_navigation)
    resume_navigation = blocking(Client.resume_navigation)

    start_recording = blocking(Client.start_recording)
    stop_recording = blocking(Client.stop_recording)
    list_recordings = blocking(Client.list_recordings)
    save_ring = blocking(Client.save_ring)
