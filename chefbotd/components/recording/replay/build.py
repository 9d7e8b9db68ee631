"""Builds a daemon that is fed from a recording, without port, worker and files."""

import asyncio
from collections import Counter
from importlib.util import find_spec
from typing import Any, NoReturn

from chefbotd.app import Daemon, Loop
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.core.events.inputs import DaemonStarted
from chefbotd.link.port import LinkParameters
from chefbotd.rpc.parameters import Role
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.gate import GateState, Mode
from chefbotd.settings import Settings
from chefbotd.settings.sections import switched_off


class RecordedLatch:
    """The gate begins as it began then, and leaves nothing behind."""

    def __init__(self, state: GateState) -> None:
        self._state = state

    def recall(self) -> GateState:
        """The state to begin in."""
        return self._state

    def keep(self, state: GateState) -> str:
        """It is in the recording."""
        return ""

    def end(self) -> None:
        """There is nothing to forget."""


class NoSupervisor:
    """Services are run by the recording."""

    failures: Counter[str] = Counter()

    async def run_restarting(self, name: str, loop: Loop, on_failure: Any) -> None:
        """Run as it is."""
        await loop()

    async def run_critical(self, name: str, loop: Loop) -> None:
        """Run as it is."""
        await loop()


async def never_open(parameters: LinkParameters, protocol: asyncio.BaseProtocol) -> NoReturn:
    """A replay opens no port."""
    raise OSError("a replay has no ports")


async def never_spawn(*arguments: object) -> NoReturn:
    """A replay starts no process."""
    raise OSError("a replay has no processes")


def gate_of(started: DaemonStarted | None) -> GateState:
    """The gate as it began; armed where that is not known."""
    if started is None:
        return GateState()
    fault = None if started.fault is None else FaultKind(started.fault)
    return GateState(Mode(started.mode), started.reason, fault=fault)


def replayed_daemon(
    settings: Settings,
    started: DaemonStarted | None,
    entries: ReplayEntries,
    *,
    listen: tuple[str, int] | None = None,
) -> Daemon:
    """The robot of this configuration, to be fed with ``entries``; its socket is to ``listen`` there."""
    return Daemon(
        _without_files(settings, listen),
        clock=entries,
        latch=RecordedLatch(gate_of(started)),
        supervisor=NoSupervisor(),
        opener=never_open,
        substitutes={"worker": never_spawn, "depth_camera": never_spawn},
        session=None if started is None else started.session,
    )


def _without_files(settings: Settings, listen: tuple[str, int] | None) -> Settings:
    """No token, certificate, description of one's own, Foxglove or announcement: these were the robot's."""
    host, port = listen or ("127.0.0.1", 0)
    api = settings.api.model_copy(
        update={
            "host": host,
            "port": port,
            "default_role": Role.OBSERVE,
            "token_file": None,
            "token_credential": None,
            "tls_certificate": None,
            "tls_key": None,
        }
    )
    page = settings.page.model_copy(
        update={"enabled": listen is not None and find_spec("aiohttp") is not None, "host": host}
    )
    robot = settings.robot.model_copy(update={"description": None})
    return settings.model_copy(update={"api": api, "page": page, "robot": robot, **switched_off(settings)})
