"""How many Python and C functions one cycle of the board calls in the whole daemon, by part; and Python's opcodes.

A count says what a time cannot: it is the same on every machine and on a busy one, so a test holds it under a bound.
Calls are of Python and C functions; frames are those of Python alone, and opcodes are what the interpreter executes in
them.
One cycle is six lines, ``t e u s i b``, in one read; one client takes odometry and wheels; the robot drives. Everything
from the readiness of the serial port to the last byte to the client is counted, on a virtual clock, with a pty as the
serial port. The event loop's own calls are left out: the daemon runs on uvloop, whose loop is not Python.

A request is a ``drive`` that says what the client said before, from its bytes to its answer.
"""

import asyncio
import os
import pty
import random
import re
import select
import statistics
import sys
import tty
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import count as numbers_from
from types import FrameType
from typing import Any, TypeVar

from benchmarks.figures import Figure, Outcome
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.link.port import BriefSerial, LinkParameters, SerialPortTransport
from chefbotd.process.build import build
from chefbotd.settings import load

TARGET = 400
FRAMES_TARGET, OPCODES_TARGET = 190, 6500
REQUEST_TARGET = 1900
CYCLES = 40
CYCLE_S = 0.01
WARM_UP = 100
AS_FAST_AS_THE_WHEELS = {"linear_m_s": 0.0942, "angular_rad_s": 0.1346}
"""Asked for what ``lines_of`` shows, so that the duty stays as it is: a cycle that changes it takes 26 calls more."""

BESIDE = 1.5
"""A cycle that takes more than this many times the median did something else, too."""

NUMBERS = numbers_from(1)
"""Ids of requests: no two are the same, as a client's are."""

TURNS = 20
"""Iterations of the loop after each read: all that follows from a cycle has happened by then."""

PARTS = {
    "firmware_protocol": "parsing",
    "chefbotd/link": "link",
    "chefbotd/driving": "drive service",
    "chefbotd/driving/odometry": "odometry",
    "chefbotd/motion/odometry": "odometry",
    "chefbotd/driving/sensors": "sensors",
    "chefbotd/sensing": "sensors",
    "chefbotd/motion": "motion",
    "chefbotd/safety": "safety",
    "chefbotd/rpc": "telemetry",
    "chefbotd/transport": "telemetry",
    "chefbotd/bus": "bus",
    "chefbotd/clock": "clock",
    "chefbotd/core": "core",
    "chefbotd/testing": "link",
    "serial_asyncio": "port",
    "serial": "port",
    "chefbotd/link/port": "port",
}
C = TypeVar("C", bound="CallCounter")
LOOP = ("/asyncio/", "/selectors.py", "<frozen")
OF_THE_VIRTUAL_LOOP = frozenset({"time", "select"})


class CallCounter:
    """Counts the calls of this thread, by part, while its context lasts."""

    def __init__(self) -> None:
        self.by_part: Counter[str] = Counter()
        self.by_function: Counter[tuple[str, str]] = Counter()
        self._parts: dict[Any, str | None] = {}

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count what is called inside."""
        sys.setprofile(self._on_event)
        try:
            yield
        finally:
            sys.setprofile(None)

    def _on_event(self, frame: FrameType, event: str, argument: Any) -> None:
        if event not in ("call", "c_call") or (part := self._part_of(frame)) is None:
            return
        self.by_part[part] += 1
        name = frame.f_code.co_qualname
        self.by_function[part, name if event == "call" else f"{name}: {argument.__name__}"] += 1

    def _part_of(self, frame: FrameType) -> str | None:
        """The part that a frame's code belongs to; of generated code, that of its caller. None: not the daemon's."""
        code = frame.f_code
        if code not in self._parts:
            self._parts[code] = part_of(code.co_filename, code.co_name)
        part = self._parts[code]
        if part == "generated":
            return None if frame.f_back is None else self._part_of(frame.f_back)
        return part


class OpcodeCounter(CallCounter):
    """Counts Python's frames, by part, and the opcodes that are executed in them."""

    def __init__(self) -> None:
        super().__init__()
        self.opcodes = 0

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count what is executed inside."""
        sys.settrace(self._on_frame)
        try:
            yield
        finally:
            sys.settrace(None)

    def _on_frame(self, frame: FrameType, event: str, argument: Any) -> Callable[..., Any] | None:
        if (part := self._part_of(frame)) is None:
            return None
        self.by_part[part] += 1
        frame.f_trace_lines, frame.f_trace_opcodes = False, True
        return self._on_opcode

    def _on_opcode(self, frame: FrameType, event: str, argument: Any) -> Callable[..., Any]:
        self.opcodes += event == "opcode"
        return self._on_opcode


def part_of(file: str, function: str) -> str | None:
    """The part that a function belongs to; ``generated`` where it has no file, None for the event loop and for us."""
    if file.startswith("<") and not file.startswith("<frozen"):
        return "generated"
    if any(each in file for each in LOOP) or "/benchmarks/" in file:
        return None
    if file.endswith("chefbotd/clock.py") and function in OF_THE_VIRTUAL_LOOP:
        return None
    found = [name for name in PARTS if f"/{name}/" in file or file.endswith(f"/{name}.py")]
    return PARTS[max(found, key=len)] if found else "other"


def run(*, quick: bool = False) -> Outcome:
    """The total with its target, and each part."""
    counted = count()
    total = Figure("calls of a cycle", float(sum(counted.values())), "", TARGET)
    parts = [Figure(part, calls, "") for part, calls in counted.most_common()]
    frames, opcodes = count_opcodes()
    request_frames, request_opcodes = count_request()
    return Outcome(
        (
            total,
            *(Figure(f"of which {each.name}", each.value, "") for each in parts),
            Figure("Python frames of a cycle", float(frames), "", FRAMES_TARGET),
            Figure("opcodes of a cycle", float(opcodes), "", OPCODES_TARGET),
            Figure("Python frames of a repeated drive", float(request_frames), ""),
            Figure("opcodes of a repeated drive", float(request_opcodes), "", REQUEST_TARGET),
        )
    )


def count(cycles: int = CYCLES) -> Counter[str]:
    """The mean number of calls of a cycle, by part."""
    counters = _ordinary(run_virtual(_measure(cycles, CallCounter))[0])
    parts = {part for each in counters for part in each.by_part}
    return Counter(
        {part: round(statistics.mean([each.by_part[part] for each in counters])) for part in parts}
    )


def count_opcodes(cycles: int = CYCLES) -> tuple[int, int]:
    """The mean numbers of Python's frames and opcodes of a cycle."""
    return _means(run_virtual(_measure(cycles, OpcodeCounter))[0])


def count_request(cycles: int = CYCLES) -> tuple[int, int]:
    """The mean numbers of Python's frames and opcodes of a ``drive`` that repeats the last one."""
    return _means(run_virtual(_measure(cycles, OpcodeCounter))[1])


def _means(counters: Iterable[OpcodeCounter]) -> tuple[int, int]:
    ordinary = _ordinary(list(counters))
    frames = statistics.mean([sum(each.by_part.values()) for each in ordinary])
    return round(frames), round(statistics.mean([each.opcodes for each in ordinary]))


def _ordinary(counters: list[C]) -> list[C]:
    """Those without what is done once in a while beside a cycle: a part of the work of each fourth cycle is in them."""
    median = statistics.median([sum(each.by_part.values()) for each in counters])
    return [each for each in counters if sum(each.by_part.values()) <= BESIDE * median]


async def _measure(cycles: int, kind: type[C]) -> tuple[list[C], list[C]]:
    """Counters of the cycles, and of the requests between them."""
    board, device = pty.openpty()
    tty.setraw(board)
    tty.setraw(device)
    settings = load(overrides={"api.host": "127.0.0.1", "api.port": 0})
    daemon = build(settings, clock=LoopClock(), opener=_opener(os.ttyname(device)), rng=random.Random(1))
    running = asyncio.create_task(daemon.run())
    reader, writer = await asyncio.open_connection(*await daemon.server.address())
    counters: list[C] = []
    requests: list[C] = []
    echo = (0, 0)
    try:
        await asyncio.sleep(0.1)  # the port is open by then
        for cycle in range(WARM_UP + cycles):
            if cycle == WARM_UP // 2:
                await _ask(reader, writer, "arm", {})
                await _ask(reader, writer, "subscribe", {"topics": ["odometry", "wheels"]})
            if cycle >= WARM_UP // 2:
                requests.append(kind())
                await _ask(reader, writer, "drive", AS_FAST_AS_THE_WHEELS, requests[-1])
            await asyncio.sleep(CYCLE_S)
            counters.append(await _cycle(cycle, echo, board, device, kind()))
            echo = _last_duty(board, echo)
    finally:
        writer.close()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        os.close(board)
        os.close(device)
    return counters[-cycles:], requests[-cycles:]


async def _cycle(number: int, echo: tuple[int, int], board: int, device: int, counter: C) -> C:
    """Send the lines of a cycle, and count until nothing more follows from them."""
    os.write(board, lines_of(number, echo))
    select.select([device], [], [], 1.0)
    with counter.counting():
        for _ in range(TURNS):
            await asyncio.sleep(0)
    return counter


def _last_duty(board: int, before: tuple[int, int]) -> tuple[int, int]:
    """The last motor command that has come to the board, which its next cycle echoes."""
    said = b""
    while select.select([board], [], [], 0)[0]:
        said += os.read(board, 4096)
    commands = re.findall(rb"s (-?\d+) (-?\d+)\r", said)
    return (int(commands[-1][0]), int(commands[-1][1])) if commands else before


def lines_of(number: int, echo: tuple[int, int]) -> bytes:
    """Six lines of a cycle: at 12.3 V the robot drives a curve, one wheel faster than the other, and obeys ``echo``."""
    micros, left, right = 20_000_000 + number * 10_000, number * 11, number * 17
    lines = (
        f"t\t{micros}\t0.01",
        f"e\t{left}\t{right}",
        "u\t87",
        f"s\t{echo[0]}.00\t{echo[1]}.00",
        "i\t0.10\t0.20\t0.30\t0.93",
        "b\t3053.00",
    )
    return "".join(f"{line}\r\n" for line in lines).encode()


async def _ask(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    method: str,
    params: dict[str, Any],
    counter: CallCounter | None = None,
) -> None:
    """Ask, and count until the answer is there; telemetry before it is read and forgotten."""
    quoted, number = str(params).replace("'", '"'), next(NUMBERS)
    writer.write(f'{{"jsonrpc":"2.0","id":{number},"method":"{method}","params":{quoted}}}\n'.encode())
    line = b""
    with nullcontext() if counter is None else counter.counting():
        while b'"id":%d,' % number not in line:
            line = await reader.readline()
    if b'"error"' in line:
        raise RuntimeError(f"{method}: {line!r}")


def _opener(path: str) -> Any:
    """Opens the pty in the loop's thread: a virtual loop waits for no other."""

    async def open_it(_: LinkParameters, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
        port = BriefSerial(path, exclusive=True)
        transport: asyncio.Transport = SerialPortTransport(asyncio.get_running_loop(), protocol, port)
        return transport

    return open_it


def main() -> None:
    """Print every function that a cycle calls, and how often on average."""
    counters, _ = run_virtual(_measure(CYCLES, CallCounter))
    total: Counter[tuple[str, str]] = Counter()
    for counter in counters:
        total.update(counter.by_function)
    for (part, name), calls in sorted(total.items(), key=lambda item: (item[0][0], -item[1])):
        print(f"{part:20} {calls / len(counters):6.1f}  {name}")


if __name__ == "__main__":
    main()
