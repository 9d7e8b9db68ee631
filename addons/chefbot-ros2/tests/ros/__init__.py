"""Real ROS processes for the tests: they run with the Python that ROS is installed for."""

import asyncio
import json
import os
import signal
import socket
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[4]
PYTHON = Path(os.environ.get("ROS_PYTHON", ROOT / "build" / "ros-venv" / "bin" / "python"))
ADVICE = f"there is no {PYTHON}: 'make addons-test' installs ROS 2 there, from PyPI"
PATIENCE_S = 100.0
Message = dict[str, Any]


def _own_domain() -> tuple[str, socket.socket]:
    """A domain that no other run of the tests has, and what keeps it: a TCP port of the number of its first UDP port.

    Domains up to 101 have ports that Linux gives to nobody by itself (DDSI-RTPS 9.6.1.1: 7400 + 250 for each domain).
    """
    for domain in range(20, 100):
        kept = socket.socket()
        try:
            kept.bind(("127.0.0.1", 7400 + 250 * domain))
        except OSError:
            kept.close()
        else:
            return str(domain), kept
    raise OSError("every domain of ROS is in use by another run of these tests")


DOMAIN, _KEPT = _own_domain()


def environment() -> dict[str, str]:
    """This computer only, and nothing of another ROS installation."""
    assert PYTHON.exists(), ADVICE
    local = {"ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return {**os.environ, **local, "PYTHONPATH": "", "RCUTILS_LOGGING_USE_STDOUT": "0"}


@asynccontextmanager
async def ros_process(*words: str, stdout: int = DEVNULL) -> AsyncIterator[Process]:
    """A program with ROS's Python, for as long as the block runs."""
    process = await asyncio.create_subprocess_exec(
        PYTHON, *words, stdin=PIPE, stdout=stdout, env=environment(), limit=1 << 24
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


@asynccontextmanager
async def bridge(port: int, *words: str) -> AsyncIterator[Process]:
    """``chefbot-ros2``, for the daemon behind a port; at the end it is asked to end, and must do so without an error."""
    program = PYTHON.parent / "chefbot-ros2"
    assert program.exists(), ADVICE
    async with ros_process(str(program), "--connect", f"127.0.0.1:{port}", *words) as process:
        yield process
        assert process.returncode is None, f"chefbot-ros2 ended by itself, with {process.returncode}"
        process.send_signal(signal.SIGINT)
        assert await asyncio.wait_for(process.wait(), PATIENCE_S) == 0


class Probe:
    """The other ROS process. What it receives is kept by topic."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self.received: dict[str, list[Message]] = {}
        self.delays_ns: dict[str, list[int]] = {}
        self._answers: dict[str, asyncio.Queue[Message]] = {}
        self._news = asyncio.Condition()

    async def read(self) -> None:
        """Take what it tells, until it ends."""
        assert self._process.stdout is not None
        async for line in self._process.stdout:
            told = json.loads(line)
            async with self._news:
                if "topic" in told:
                    self.received.setdefault(told["topic"], []).append(told["message"])
                    if "header" in told["message"]:
                        age_ns = told["received_ns"] - stamp_ns(told["message"])
                        self.delays_ns.setdefault(told["topic"], []).append(age_ns)
                else:
                    key = told.get("service") or told.get("of") or "ready"
                    self._answers.setdefault(key, asyncio.Queue()).put_nowait(told)
                self._news.notify_all()

    async def _do(self, **command: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(command).encode() + b"\n")
        await self._process.stdin.drain()

    async def answer_of(self, key: str) -> Message:
        """What it answers."""
        queue = self._answers.setdefault(key, asyncio.Queue())
        return await asyncio.wait_for(queue.get(), PATIENCE_S)

    async def subscribe(self, topic: str, type_name: str, qos: str = "reliable") -> None:
        """Listen to a topic."""
        await self._do(do="subscribe", topic=topic, type=type_name, qos=qos)

    async def publish(self, topic: str, type_name: str, fields: Message) -> None:
        """Publish once."""
        await self._do(do="publish", topic=topic, type=type_name, fields=fields)

    async def publish_timed(self, topic: str, type_name: str, fields: Message) -> int:
        """Publish once; when, in nanoseconds since 1970."""
        await self._do(do="publish_timed", topic=topic, type=type_name, fields=fields)
        at_ns: int = (await self.answer_of("published"))["at_ns"]
        return at_ns

    async def until_listened(self, topic: str, type_name: str) -> None:
        """Until somebody listens to what we are going to publish."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                await self._do(do="listeners", topic=topic, type=type_name)
                if (await self.answer_of(topic))["listeners"]:
                    return
                await asyncio.sleep(0.05)

    async def call(self, service: str, type_name: str, fields: Message | None = None) -> Message:
        """Call a service."""
        await self._do(do="call", service=service, type=type_name, fields=fields or {})
        answer: Message = (await self.answer_of(service))["answer"]
        return answer

    async def until(self, topic: str, holds: Callable[[Message], bool] = lambda message: True) -> Message:
        """The first message of a topic, from now on, of which this holds."""
        count = len(self.received.get(topic, []))
        async with asyncio.timeout(PATIENCE_S):
            async with self._news:
                while True:
                    messages = self.received.get(topic, [])
                    for message in messages[count:]:
                        if holds(message):
                            return message
                    count = len(messages)
                    await self._news.wait()

    async def kill(self) -> None:
        """It dies, without a word."""
        self._process.kill()
        await self._process.wait()


@asynccontextmanager
async def probe() -> AsyncIterator[Probe]:
    """A running probe."""
    async with ros_process(str(Path(__file__).with_name("probe.py")), stdout=PIPE) as process:
        running = Probe(process)
        reader = asyncio.create_task(running.read())
        try:
            await running.answer_of("ready")
            yield running
        finally:
            reader.cancel()
            await asyncio.gather(reader, return_exceptions=True)


def stamp_ns(message: Message) -> int:
    """A header's stamp."""
    stamp: dict[str, int] = message["header"]["stamp"]
    return stamp["sec"] * 1_000_000_000 + stamp["nanosec"]
