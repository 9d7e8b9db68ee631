"""Whether memory stays flat under storms: of the daemon, its worker, rosbridge, a fleet's agent and the fleet's manager.

    python -m benchmarks.storms [--minutes 30]

Storm after storm on each open port, and on the broker: bad first messages, crowds, askers, odd states and orders.
Programs of add-ons that are not installed are left out, and said so. The growth is that of the median resident memory,
from the second quarter of the time to the last one.
"""

import argparse
import contextlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib.util import find_spec
from itertools import cycle
from pathlib import Path
from typing import Any

import psutil
from rich.console import Console

from benchmarks.abuse import SHAPES, ask_repeatedly, connect_crowd, sample_in_background, send_body
from benchmarks.figures import Figure, Outcome, table
from chefbotd.transport.ports import reserve_port

MOST_GROWTH_MB = 10.0
STARTS_WITHIN_S = 400.0
"""The manager looks for lanes first, on a computer that may be busy."""

CROWD, ASKERS, MESSAGES = 200, 20, 100
SERIAL = "storm"
MASTER_TOPICS = (f"uagv/v2/chefbot/{SERIAL}/order", f"uagv/v2/chefbot/{SERIAL}/instantActions")
ODD = (
    b"{}",
    b"[" * 1000,
    b'{"orderId": ""}',
    b'{"headerId": 1e400}',
    b"\xff\xfe",
    b'{"nodes": [' + b"{}," * 5000,
)

Program = tuple[list[str], int]
"""A command, and the port that it opens; 0: none."""


def programs(folder: Path, broker: int) -> dict[str, Program]:
    """What is installed, by its name."""
    port, bridge, page = reserve_port(), reserve_port(), reserve_port()
    python = [sys.executable, "-P", "-m"]
    run = ["chefbotd.cli.programs.chefbotd", "run", "--sim", "--config", "chefbot_lidar"]
    found = {"daemon": ([*python, *run, "--listen", f"127.0.0.1:{port}"], port)}
    if find_spec("chefbot_ros2"):
        where = ["--connect", f"127.0.0.1:{port}", "--port", str(bridge)]
        found["rosbridge"] = ([*python, "chefbot_ros2.rosbridge.server", *where], bridge)
    if broker and find_spec("chefbot_vda5050"):
        where = [f"127.0.0.1:{broker}", SERIAL, "--daemon", f"127.0.0.1:{port}"]
        found["agent"] = ([*python, "chefbot_vda5050.cli", "run", *where], 0)
    if broker and find_spec("chefbot_fleet"):
        found["manager"] = ([*python, "chefbot_fleet.cli", "run", *_manager(folder, broker, page)], page)
    return found


def _manager(folder: Path, broker: int, page: int) -> list[str]:
    import yaml
    from chefbot_fleet.demo.story import MAP, PLACES

    (folder / "places.yaml").write_text(yaml.safe_dump({name: list(at) for name, at in PLACES.items()}))
    (folder / "token").write_text("a token for storms, of no use elsewhere")
    files = ["--database", str(folder / "fleet.db"), "--token-file", str(folder / "token")]
    return [str(MAP), str(folder / "places.yaml"), f"127.0.0.1:{broker}", *files, "--port", str(page)]


@contextlib.contextmanager
def broker_in(folder: Path) -> Iterator[int]:
    """Debian's broker, and its port; 0 where it is not installed."""
    path = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
    if path is None:
        yield 0
        return
    port = reserve_port()
    (folder / "mosquitto.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    with _started([path, "-c", str(folder / "mosquitto.conf")], folder / "broker.log", port):
        yield port


@contextlib.contextmanager
def _started(command: list[str], log: Path, port: int) -> Iterator["subprocess.Popen[bytes]"]:
    with log.open("wb") as sink:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=sink, stderr=sink, cwd=log.parent
        )
    try:
        _until_listening(process, port, log)
        yield process
    finally:
        process.terminate()
        try:
            process.wait(30.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _until_listening(process: "subprocess.Popen[bytes]", port: int, log: Path) -> None:
    end_s = time.monotonic() + STARTS_WITHIN_S
    while port:
        with contextlib.suppress(OSError):
            _crowd_of_one(port)
            return
        if process.poll() is not None or time.monotonic() > end_s:
            raise RuntimeError(f"it does not listen: {log.read_text(errors='replace')[-1000:]}")
        time.sleep(0.2)


def _crowd_of_one(port: int) -> None:
    import socket

    socket.create_connection(("127.0.0.1", port), timeout=1.0).close()


def _odd_messages(broker: int) -> None:
    """To the agent as its master, and to the manager as robots without end."""
    from paho.mqtt import publish

    states = [f"uagv/v2/maker/r{time.time_ns() + k}/state" for k in range(MESSAGES)]
    topics = [*states, *MASTER_TOPICS * (MESSAGES // 2)]
    messages: list[Any] = [(topic, odd, 0, False) for topic, odd in zip(topics, cycle(ODD), strict=False)]
    publish.multiple(messages, "127.0.0.1", broker)


def storms(found: Mapping[str, Program], broker: int) -> list[Callable[[], None]]:
    """One after the other, again and again."""
    ports = [port for _, port in found.values() if port]
    bad = [partial(send_body, *shape, 1, port) for port in ports for shape in SHAPES.values()]
    crowds = [partial(connect_crowd, CROWD, port) for port in ports]
    asking = [
        partial(ask_repeatedly, ASKERS, method, found["daemon"][1])
        for method in ("get_state", "describe", "list_maps")
    ]
    return [*bad, *crowds, *asking, *([partial(_odd_messages, broker)] * 5 if broker else [])]


def resident_mb(processes: Mapping[str, "subprocess.Popen[bytes]"]) -> dict[str, float]:
    """Of each program, and of the daemon's worker."""
    found = {name: psutil.Process(process.pid) for name, process in processes.items()}
    for child in found["daemon"].children():
        with contextlib.suppress(psutil.Error):
            if any("worker" in word for word in child.cmdline()):
                found["worker"] = child
    sizes = {}
    for name, process in found.items():
        with contextlib.suppress(psutil.Error):
            sizes[name] = process.memory_info().rss / 1e6
    return sizes


def run(minutes: float) -> Outcome:
    """How much each grew, and whether each still runs."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="chefbotd-storms-")))
        broker = stack.enter_context(broker_in(folder))
        found = programs(folder, broker)
        running = {
            name: stack.enter_context(_started(command, folder / f"{name}.log", port))
            for name, (command, port) in found.items()
        }
        end_s, count = time.monotonic() + 60.0 * minutes, 0
        with sample_in_background(1.0, lambda: resident_mb(running)) as samples:  # type: ignore[arg-type, return-value]
            for storm in cycle(storms(found, broker)):
                if time.monotonic() > end_s:
                    break
                with contextlib.suppress(OSError):
                    storm()
                count += 1
        ended = tuple(f"{name} has ended" for name, process in running.items() if process.poll() is not None)
    return outcome_of(samples, minutes, count, ended)  # type: ignore[arg-type]


def outcome_of(
    samples: list[dict[str, float]], minutes: float, count: int, ended: tuple[str, ...]
) -> Outcome:
    """What the samples, one a second, say; ``ended`` is what ended meanwhile."""
    figures, faults = [], list(ended)
    for name in sorted({name for sample in samples for name in sample}):
        sizes = [sample[name] for sample in samples if name in sample]
        quarter = max(1, len(sizes) // 4)
        grown = statistics.median(sizes[-quarter:]) - statistics.median(sizes[quarter : 2 * quarter] or sizes)
        figures += [
            Figure(f"{name}: memory at the end", sizes[-1], "MB"),
            Figure(f"{name}: grown", grown, "MB", MOST_GROWTH_MB),
        ]
        if grown > MOST_GROWTH_MB:
            faults.append(f"{name} grew by {grown:.1f} MB")
    left_out = {"rosbridge", "agent", "manager", "worker"} - {name for sample in samples for name in sample}
    remarks = (
        f"{count} storms in {minutes:g} minutes",
        f"left out: {', '.join(sorted(left_out)) or 'nothing'}",
    )
    return Outcome(tuple(figures), remarks, tuple(faults))


def main() -> int:
    """Print the figures; returns 1 when something grew or ended."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.storms")
    parser.add_argument("--minutes", type=float, default=30.0)
    outcome = run(parser.parse_args().minutes)
    console = Console()
    console.print(table({"storms": outcome}))
    for line in (*outcome.remarks, *(f"WRONG: {fault}" for fault in outcome.faults)):
        console.print(line, highlight=False)
    return int(bool(outcome.faults))


if __name__ == "__main__":
    sys.exit(main())
