"""The program chefbotctl against a real daemon that keeps maps, each command a run of its own."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs

from chefbotd.cli.programs.chefbotctl import main
from chefbotd.clock import LoopClock
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.process.build import build
from chefbotd.settings import load
from chefbotd.testing.transport import FakeSerialDevice
from tests.chefbotd.conftest import Control
from tests.waiting import PATIENCE_S


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the daemon keeps its maps."""
    return tmp_path / "maps"


@pytest.fixture
def mapctl(folder: Path) -> Iterator[Control]:
    """Runs ``chefbotctl --connect <daemon> ARGS...``; the daemon runs meanwhile in a thread, in real time."""
    with _daemon(MapsParameters(folder=folder)) as port:
        yield lambda *args: CliRunner().invoke(main, [f"--connect=127.0.0.1:{port}", *args])


@pytest.fixture
def without_maps() -> Iterator[Control]:
    """The same with a daemon that keeps none."""
    with _daemon(None) as port:
        yield lambda *args: CliRunner().invoke(main, [f"--connect=127.0.0.1:{port}", *args])


@contextmanager
def _daemon(maps: MapsParameters | None) -> Iterator[int]:
    api = load().api.model_copy(update={"host": "127.0.0.1", "port": 0})
    settings = load().model_copy(update={"maps": maps, "api": api})
    loop, started, ports = asyncio.new_event_loop(), threading.Event(), []

    async def serve() -> None:
        daemon = build(settings, clock=LoopClock(), opener=FakeSerialDevice().open)
        running = asyncio.current_task()
        assert running is not None

        async def report() -> None:
            ports.append(((await daemon.server.address())[1], running))
            started.set()

        with suppress(asyncio.CancelledError):
            await daemon.run(report)

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    assert started.wait(PATIENCE_S), "the daemon did not start"
    port, running = ports[0]
    try:
        with capture_logs():  # the log would be in the output of the commands
            yield port
    finally:
        loop.call_soon_threadsafe(running.cancel)
        thread.join(PATIENCE_S)
        loop.run_until_complete(loop.shutdown_default_executor())
        loop.close()
