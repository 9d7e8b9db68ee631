"""Builds a daemon with the latch file and the supervisor of its process."""

import asyncio
import random
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Mapping, Sequence
from pathlib import Path
from typing import Any

import structlog

from chefbotd.app import Daemon
from chefbotd.clock import Clock
from chefbotd.composition.context import NO_SUBSTITUTES, FeatureBuilder
from chefbotd.core.sentence import Sentence
from chefbotd.link.board_memory import BoardMemory
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import Opener
from chefbotd.process.latch_file import LatchFile, path_of
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.settings import Settings
from chefbotd.settings.notes import notes

log = structlog.get_logger(component="supervisor")

Loop = Callable[[], Coroutine[Any, Any, None]]

MOST_FAILURES = 5
WITHIN_S = 60.0
"""With more failures than this within ``WITHIN_S`` the process ends; systemd may restart it."""


class ServiceLost(Exception):
    """A critical service has ended, or a service has failed too often."""


class Supervisor:
    """Runs services; ``failures`` counts by name."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._recent_s: deque[float] = deque()
        self.failures: Counter[str] = Counter()

    async def run_restarting(self, name: str, loop: Loop, on_failure: Callable[[Fault], None]) -> None:
        """Run a service until cancelled; after it has ended or failed, call ``on_failure`` and start it again.

        Raises:
            ServiceLost: services have failed more than ``MOST_FAILURES`` times ``WITHIN_S``.
        """
        while True:
            self._record_failure(name, await _end_of(name, loop), on_failure)

    async def run_critical(self, name: str, loop: Loop) -> None:
        """Run a critical service; its error is passed on.

        Raises:
            ServiceLost: it ended without one, or somebody cancelled it.
        """
        error = await _end_of(name, loop)
        raise error or ServiceLost(f"{name} has ended")

    def _record_failure(
        self, name: str, error: Exception | None, on_failure: Callable[[Fault], None]
    ) -> None:
        self.failures[name] += 1
        log.error("a service has failed", service=name, error=repr(error), exc_info=error)
        if error is None:
            reason = Sentence(
                "driving.service_cancelled", "the service '{name}' failed: was cancelled", name=name
            )
        else:
            reason = Sentence(
                "driving.service_failed", "the service '{name}' failed: {error}", name=name, error=repr(error)
            )
        on_failure(Fault(FaultKind.SERVICE_FAILED, reason))
        now_s = self._clock.now_s()
        self._recent_s.append(now_s)
        while now_s - self._recent_s[0] > WITHIN_S:
            self._recent_s.popleft()
        if len(self._recent_s) > MOST_FAILURES:
            raise ServiceLost(f"{len(self._recent_s)} failures within {WITHIN_S:g} s") from error


async def _end_of(name: str, loop: Loop) -> Exception | None:
    """Run it in its own task, so that its cancellation is not taken for ours; returns its error or None."""
    task = asyncio.create_task(loop(), name=name)
    try:
        await asyncio.wait({task})
    finally:
        if not task.done():
            task.cancel()
            await asyncio.wait({task})
    error = None if task.cancelled() else task.exception()
    if error is None or isinstance(error, Exception):
        return error
    raise error


def build(
    settings: Settings,
    *,
    clock: Clock,
    opener: Opener = open_port,
    simulated: bool = False,
    rng: random.Random | None = None,
    features: Sequence[FeatureBuilder] = (),
    substitutes: Mapping[str, Any] = NO_SUBSTITUTES,
    config_file: Path | None = None,
    own_process: bool = False,
    board_memory: BoardMemory | None = None,
) -> Daemon:
    """The robot of this configuration, ready to run; the rest is as in ``Daemon``."""
    for note in notes(settings):
        log.warning("about the configuration", note=note)
    return Daemon(
        settings,
        clock=clock,
        latch=LatchFile(path_of(settings.latch, settings.robot.name, simulated=simulated)),
        supervisor=Supervisor(clock),
        opener=opener,
        simulated=simulated,
        rng=rng,
        features=features,
        substitutes=substitutes,
        config_file=config_file,
        own_process=own_process,
        board_memory=board_memory,
    )
