"""What hostile clients cost: memory, control steps, and the answers of the client that drives meanwhile.

Fourteen shapes of a bad first message, each followed by 100 MB; a thousand connections at once; a crowd that reads
nothing, and one that floods besides, with what looks like a stop and is none; a hundred that keep to every limit and
ask for what is costly. All while a well-behaved client drives at 10 Hz and a board sends encoder frames at 50 Hz. Then
how long an e-stop takes while those hundred ask.

    python -m benchmarks.abuse [--quick]
"""

import argparse
import contextlib
import selectors
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from rich.console import Console

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, percentile, table
from benchmarks.frames import lost
from benchmarks.rig import Daemon, connect, daemon
from benchmarks.rpc import Caller

CYCLE_HZ = 50
BODY_MB = 100
CROWD = 1000
DEAF = 50
ASKERS = 100
ASK_S = 4.0
ESTOPS = 20
MEMORY_LIMIT_MB = 25.0
CHUNK = 65_536

_CALL = b'{"jsonrpc":"2.0","id":1,"method":'
SHAPES: dict[str, tuple[bytes, bytes]] = {
    "HTTP request": (b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 104857600\r\n\r\n", b"a=b&"),
    "TLS hello": (bytes.fromhex("16030100c8010000c40303"), b"\x00"),
    "SSH banner": (b"SSH-2.0-x\r\n", b"\x00\x00\x00\x14"),
    "random bytes": (bytes(range(256)), bytes(range(255, -1, -1))),
    "NULs": (b"\x00", b"\x00"),
    "line ends": (b"\n", b"\r\n"),
    "text": (b"go forward ", b"please "),
    "lines of text": (b"go forward\n", b"please\n"),
    "empty objects": (b"{}\n", b"{}\n"),
    "open brackets": (b"[", b"["),
    "endless string": (_CALL + b'"', b"x"),
    "endless number": (_CALL + b'"drive","params":{"linear_m_s":', b"9"),
    "endless spaces": (_CALL, b" "),
    "valid requests": (_CALL + b'"describe"}\n', _CALL + b'"ping"}\n'),
}


def run(*, quick: bool = False) -> Outcome:
    """Memory grown at its peak, the driver's answers, and the control steps held against the frames sent."""
    body_mb, crowd = (BODY_MB // 10, CROWD // 4) if quick else (BODY_MB, CROWD)
    attacks = {name: partial(send_body, *shape, body_mb) for name, shape in SHAPES.items()}
    attacks["a crowd at once"] = partial(connect_crowd, crowd)
    attacks["a crowd that does not read"] = partial(_deaf, DEAF)
    attacks["a crowd that floods and does not read"] = partial(_deaf_flood, DEAF)
    for method in ("get_state", "describe"):
        attacks[f"a crowd that asks for {method}"] = partial(ask_repeatedly, ASKERS, method)
    with board() as instrument, daemon(instrument.device) as running, connect(running) as caller:
        instrument.start(1 / CYCLE_HZ)
        caller.drive_for(1.0, 0.1, 0.0)
        with _watched_memory(running) as memory, _driven(running) as answers_s:
            took_s = {name: _timed(attack, running.port) for name, attack in attacks.items()}
        estops_s = _estops(caller, running.port)
        instrument.pause()
        sent = instrument.collect().sent
        faults = lost(caller, sent)
        stats = caller.call("get_stats")
    grown_mb = max(memory) - memory[0]
    worst = max(took_s, key=took_s.__getitem__)
    if grown_mb > MEMORY_LIMIT_MB:
        faults = (*faults, f"memory grew by {grown_mb:.1f} MB")
    return Outcome(
        (
            Figure("memory grown at the peak", grown_mb, "MB", MEMORY_LIMIT_MB),
            Figure("driver's answer p50", percentile(answers_s, 50) * 1e3, "ms"),
            Figure("driver's answer p99", percentile(answers_s, 99) * 1e3, "ms"),
            Figure("driver's answer worst", max(answers_s) * 1e3, "ms", 500.0),
            Figure("e-stop while a hundred ask p50", percentile(estops_s, 50) * 1e3, "ms"),
            Figure("e-stop while a hundred ask worst", max(estops_s) * 1e3, "ms", 100.0),
            Figure("control steps missed", sent["e"] - stats["control_steps"], "steps", 0),
        ),
        (
            f"{len(attacks)} attacks; the longest, {worst}, took {took_s[worst]:.1f} s",
            f"clients refused: {stats['clients_refused']}",
        ),
        faults,
    )


def _timed(attack: Callable[[int], None], port: int) -> float:
    began_s = time.monotonic()
    attack(port)
    return time.monotonic() - began_s


def send_body(first: bytes, body: bytes, megabytes: int, port: int) -> None:
    """Send the first message and then the body again and again, until all is sent or we are cut off."""
    chunk = body * (CHUNK // len(body))
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as client, contextlib.suppress(OSError):
        client.sendall(first)
        for _ in range(megabytes * 1_000_000 // len(chunk)):
            client.sendall(chunk)


def connect_crowd(count: int, port: int) -> None:
    """Connect so many clients before any of them does anything, hold them for a moment, and go."""
    with contextlib.ExitStack() as crowd:
        for _ in range(count):
            client = crowd.enter_context(socket.socket())
            client.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                client.connect(("127.0.0.1", port))
        time.sleep(1.0)
    time.sleep(0.5)


def _deaf(count: int, port: int) -> None:
    """Subscribe to everything and ask for long answers without reading, until the daemon has had enough."""
    ask = _CALL + b'"subscribe","params":{"topics":["odometry","wheels","raw"],"policy":"ordered"}}\n'
    with contextlib.ExitStack() as crowd:
        for _ in range(count):
            client = crowd.enter_context(socket.create_connection(("127.0.0.1", port)))
            client.setblocking(False)
            with contextlib.suppress(OSError):
                client.send(ask + (_CALL + b'"describe"}\n') * 200)
        time.sleep(7.0)


def _deaf_flood(count: int, port: int) -> None:
    """Ask without reading for as fast as it is taken, for three seconds, with new clients for those that are cut off."""
    flood, over_s = _CALL + b'"set_client_name","params":{"client":"stop"}}\n', time.monotonic() + 3.0
    crowd: list[socket.socket] = []
    while time.monotonic() < over_s:
        while len(crowd) < count:
            crowd.append(socket.create_connection(("127.0.0.1", port)))
            crowd[-1].setblocking(False)
            crowd[-1].send((_CALL + b'"describe"}\n') * 200)
        crowd = [client for client in crowd if _goes_on(client, flood * 500)]
    for client in crowd:
        client.close()


def ask_repeatedly(count: int, method: str, port: int) -> None:
    """Ask for the same, 32 times in a row, and read the answers before asking again: within every limit there is."""
    requests, over_s = (_CALL + b'"%b"}\n' % method.encode()) * 32, time.monotonic() + ASK_S
    with contextlib.ExitStack() as crowd, selectors.DefaultSelector() as readable:
        unread: dict[socket.socket, int] = {}
        for _ in range(count):
            client = crowd.enter_context(socket.create_connection(("127.0.0.1", port)))
            readable.register(client, selectors.EVENT_READ)
            unread[client] = 1  # the greeting
        while time.monotonic() < over_s:
            for key, _ in readable.select(0.1):
                client = key.fileobj  # type: ignore[assignment]
                unread[client] -= client.recv(1 << 20).count(b"\n")
                if unread[client] == 0:
                    client.sendall(requests)
                    unread[client] = 32


def _estops(caller: Caller, port: int) -> list[float]:
    """How long an e-stop takes while a crowd asks, from the request to the answer, in seconds."""
    crowd, took_s = threading.Thread(target=ask_repeatedly, args=(ASKERS, "get_state", port)), []
    crowd.start()
    for _ in range(ESTOPS):
        time.sleep(ASK_S / 2 / ESTOPS)
        began_s = time.monotonic()
        caller.call("estop")
        took_s.append(time.monotonic() - began_s)
        caller.call("arm")
    crowd.join()
    return took_s


def _goes_on(client: socket.socket, data: bytes) -> bool:
    """Send what is taken; whether the client is still connected."""
    try:
        client.send(data)
    except BlockingIOError:
        pass
    except OSError:
        client.close()
        return False
    return True


@contextmanager
def _watched_memory(running: Daemon) -> Iterator[list[float]]:
    """The daemon's resident megabytes, sampled at 50 Hz while the block lasts; first those before it."""
    with sample_in_background(0.02, running.resident_mb) as samples:
        yield samples


@contextmanager
def _driven(running: Daemon) -> Iterator[list[float]]:
    """Somebody drives at 10 Hz while the block lasts: how long each answer took, in seconds."""
    caller = Caller(running.port)

    def drive() -> float:
        began_s = time.monotonic()
        caller.call("drive", linear_m_s=0.1, angular_rad_s=0.0, source="navigation")
        return time.monotonic() - began_s

    with caller, sample_in_background(0.1, drive) as samples:
        yield samples


@contextmanager
def sample_in_background(period_s: float, sample: Callable[[], float]) -> Iterator[list[float]]:
    """What ``sample`` returned, first and once in each period, until the end of the block."""
    samples, over = [sample()], threading.Event()

    def repeat() -> None:
        while not over.wait(period_s):
            samples.append(sample())

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        yield samples
    finally:
        over.set()
        thread.join()


def main() -> int:
    """Print the figures; returns 1 when something is wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.abuse")
    parser.add_argument("--quick", action="store_true", help="a tenth of the bodies, a quarter of the crowd")
    outcome = run(quick=parser.parse_args().quick)
    console = Console()
    console.print(table({"abuse": outcome}))
    for line in (*outcome.remarks, *(f"WRONG: {fault}" for fault in outcome.faults)):
        console.print(line, highlight=False)
    return int(bool(outcome.faults))


if __name__ == "__main__":
    sys.exit(main())
