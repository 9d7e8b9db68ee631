"""Golden pairs: what went into the daemon, and every event and command that came out, exactly.

``python -m tests.scenarios.golden`` records the inputs anew on the simulated robot and rewrites the outputs. Look at the
difference before it is committed: each line of it is a change of behaviour.
"""

import asyncio
import contextlib
import dataclasses
import inspect
import json
import random
import re
from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import asdict, astuple

from chefbotd.client import CallError, Client
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core import events
from chefbotd.core.record import Record
from chefbotd.driving.safety_supervisor import LATCHES_PER_SESSION
from chefbotd.process.build import build
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.transport import FakeSerialDevice

FOLDER = Path(__file__).parent.parent / "vectors" / "golden"
ADDRESS = re.compile(r"127\.0\.0\.1:\d+")
UNRECORDED = (events.StatsSampled, events.TruthSimulated, events.LineSeen, events.DutyWritten)
EVENTS = tuple(
    each
    for _, each in inspect.getmembers(events, inspect.isclass)
    if issubclass(each, Record) and "stamp_s" in each.__struct_fields__ and each not in UNRECORDED
)


TIMES = ("stamp_s", "arrival_s", "board_s")


@dataclass(frozen=True)
class Step:
    """One input: bytes from the board, a call on the socket, or the cable; ``at_s`` counts from the start."""

    at_s: float
    kind: str
    value: Any

    def dump(self) -> str:
        """As a line of JSON; bytes are written as Latin-1."""
        value = self.value.decode("latin-1") if isinstance(self.value, bytes) else self.value
        return json.dumps({"at_s": round(self.at_s, 6), self.kind: value})

    @classmethod
    def parse(cls, line: str) -> "Step":
        """The step that ``dump`` wrote."""
        fields = json.loads(line)
        at_s = fields.pop("at_s")
        ((kind, value),) = fields.items()
        return cls(at_s, kind, value.encode("latin-1") if kind == "board" else value)


Play = Callable[[SimulatedRobot], Awaitable[None]]


@dataclass(frozen=True)
class Story:
    """What happens, to which robot, and how it is set up (keys as of ``load``)."""

    play: Play
    robot: str = "chefbot"
    set_up: Mapping[str, object] = dataclasses.field(default_factory=dict)

    def settings(self, **overrides: Any) -> Settings:
        """The packaged robot's, set up as the story asks."""
        return load(packaged(self.robot), overrides={**self.set_up, **overrides})


def replay(story: Story, steps: list[Step]) -> list[str]:
    """Feed the steps at their times to a daemon; every event and every line it sends, in order, one a line."""
    said: list[str] = []

    async def scenario() -> None:
        device, clock = FakeSerialDevice(), LoopClock()
        start_s = clock.now_s()
        device.on_write = lambda data: said.append(f"{clock.now_s() - start_s:.6f} > {data!r}")
        settings = story.settings(**{"api.host": "127.0.0.1", "api.port": 0})
        daemon = build(settings, clock=clock, opener=device.open, rng=random.Random(1))
        inbox = daemon.bus.subscribe(*EVENTS, size=100_000)
        running = asyncio.create_task(daemon.run())
        async with Client.connect(*await daemon.server.address()) as client:
            for step in steps:
                await asyncio.sleep(max(0.0, start_s + step.at_s - clock.now_s()))
                await _apply(step, device, client)
                await asyncio.sleep(0.0005)
                said.extend(_tell(inbox.take_event(), start_s) for _ in range(len(inbox)))
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    run_virtual(scenario())
    return said


async def _apply(step: Step, device: FakeSerialDevice, client: Client) -> None:
    if step.kind == "board":
        device.feed(step.value)
    elif step.kind == "cable":
        device.plug() if step.value == "plug" else device.unplug()
    else:
        method, params = step.value
        with contextlib.suppress(CallError):
            await client.call(method, **params)


def _tell(event: Any, start_s: float) -> str:
    fields, values = [], asdict(event)
    for name, value in sorted(values.items(), key=lambda item: item[0] not in TIMES):
        if name in TIMES:
            value -= start_s
        elif name in ("latch", "stop_number"):
            value %= LATCHES_PER_SESSION  # no two starts of a daemon have the same
        fields.append(f"{name}={_text(value)}")
    return f"  {type(event).__name__}({', '.join(fields)})"


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value + 0.0:.7g}" if abs(value) > 1e-9 else "0"
    if isinstance(value, np.ndarray):
        return _text(value.ravel().tolist())
    if isinstance(value, tuple | list):
        return "(" + ", ".join(map(_text, value)) + ")"
    if isinstance(value, Record):
        return _text(astuple(value))
    return ADDRESS.sub("client", str(value) if isinstance(value, str) else repr(value))


def record(story: Story) -> list[Step]:
    """Let a story happen on the simulated robot and note all that goes into its daemon."""
    steps: list[Step] = []

    async def scenario() -> None:
        async with simulated_robot(story.settings(**{"sim.board.cycle_s": 0.05})) as robot:
            clock = LoopClock()
            start_s = clock.now_s()

            def note(kind: str, value: Any) -> None:
                steps.append(Step(clock.now_s() - start_s, kind, value))

            _tap(robot, note)
            await story.play(robot)

    run_virtual(scenario())
    return steps


def _tap(robot: SimulatedRobot, note: Callable[[str, Any], None]) -> None:
    feed, call = robot.device.feed, robot.client.call
    unplug, plug = robot.device.unplug, robot.device.plug

    async def noted_call(method: str, /, *, on_progress: Any = None, **params: Any) -> dict[str, Any]:
        note("call", [method, params])
        return await call(method, on_progress=on_progress, **params)

    def noted_feed(data: bytes) -> None:
        note("board", data)
        feed(data)

    robot.device.feed = noted_feed  # type: ignore[method-assign]
    robot.client.call = noted_call  # type: ignore[method-assign]
    robot.device.unplug = lambda: (note("cable", "unplug"), unplug())[1]  # type: ignore[method-assign]
    robot.device.plug = lambda: (note("cable", "plug"), plug())[1]  # type: ignore[method-assign]


async def _drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.1)


async def drive_and_stop(robot: SimulatedRobot) -> None:
    """Boot, a curve, a stop, a silent client."""
    await asyncio.sleep(0.5)
    await _drive(robot, 0.2, 0.5, 1.0)
    await robot.client.stop()
    await asyncio.sleep(0.5)
    await robot.client.drive(-0.1, 0.0)
    await asyncio.sleep(1.0)


async def estop_and_arm(robot: SimulatedRobot) -> None:
    """An e-stop in mid-drive, refused commands, release, and a drive from rest."""
    await asyncio.sleep(0.5)
    await _drive(robot, 0.2, 0.0, 0.5)
    await robot.client.call("estop")
    for method in ("drive", "arm", "drive"):
        params = {"linear_m_s": 0.1, "angular_rad_s": 0.0} if method == "drive" else {}
        with contextlib.suppress(CallError):
            await robot.client.call(method, **params)
        await asyncio.sleep(0.2)


async def faults_on_the_wire(robot: SimulatedRobot) -> None:
    """Noise, damaged lines, a pulled cable, a board that resets; then armed again."""
    await asyncio.sleep(0.5)
    await _drive(robot, 0.2, 0.0, 0.5)
    for noise in (b"\x00\xff\n", b"e\t12\n", b"e\t9999999\t3\n", b"t\t7\t0.05\n", b"u\t-4\n", b"half a li"):
        robot.device.feed(noise)
        await _drive(robot, 0.2, 0.0, 0.1)
    robot.device.unplug()
    await asyncio.sleep(0.3)
    robot.device.plug()
    await asyncio.sleep(1.0)
    await robot.client.call("arm")
    await _drive(robot, 0.1, 0.0, 0.3)
    await robot.client.call("reset_board")
    await asyncio.sleep(2.0)
    await robot.client.call("arm")
    await _drive(robot, 0.1, 0.0, 0.3)


async def drive_a_second(robot: SimulatedRobot) -> None:
    """Boot, a second's curve, a stop."""
    await asyncio.sleep(0.5)
    await _drive(robot, 0.2, 0.5, 1.0)
    await robot.client.stop()
    await asyncio.sleep(0.3)


CUPBOARD_AHEAD = {"sim.world.start_x_m": 1.2, "sim.world.start_y_m": 0.8}
"""Something that the infrared sensor sees."""

STORIES = {
    "drive_and_stop": Story(drive_and_stop),
    "estop_and_arm": Story(estop_and_arm),
    "faults_on_the_wire": Story(faults_on_the_wire),
    "khan": Story(drive_a_second, "khan", CUPBOARD_AHEAD),
    "khan_edges": Story(drive_a_second, "khan", {**CUPBOARD_AHEAD, "robot.wire": "khan_edges"}),
}


def read(name: str) -> tuple[list[Step], list[str]]:
    """A pair: the steps, and what they must bring out."""
    steps = [Step.parse(line) for line in (FOLDER / f"{name}.in.jsonl").read_text().splitlines()]
    return steps, (FOLDER / f"{name}.out.txt").read_text().splitlines()


def rewrite() -> Iterator[str]:
    """Record every story and write its pair; yields the names."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, story in STORIES.items():
        recorded = [step.dump() for step in record(story)]
        said = replay(story, [Step.parse(line) for line in recorded])
        (FOLDER / f"{name}.in.jsonl").write_text("".join(line + "\n" for line in recorded))
        (FOLDER / f"{name}.out.txt").write_text("".join(line + "\n" for line in said))
        yield name


if __name__ == "__main__":
    for written in rewrite():
        print(written)  # noqa: T201
