"""Whether an e-stop arrives beside a crowd of silent connections, and how long it takes.

A crowd of four loopback addresses connects 1,000 times a second and shows nothing. Beside it one client after the other
comes step by step (it connects, is greeted, shows its token, and asks for an e-stop), each message 20 ms on its way;
and others that have shown their tokens before the crowd came ask for theirs.

    python -m benchmarks.crowd [--quick] [--per-s 1000] [--estops 200] [--tls FOLDER]
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import socket
import ssl
import sys
import tempfile
import time
from collections import deque
from pathlib import Path

from rich.console import Console

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, percentile, table
from benchmarks.rig import READY_WITHIN_S, Daemon, daemon

TOKEN = "observe-token-of-the-crowd"
AWAY_S = 0.02
ADDRESSES = 4
HELD = 2500
"""Silent connections that the crowd keeps open: more than there are slots."""
ANSWER_S = 5.0


def run(per_s: int, estops: int, tls: Path | None = None) -> Outcome:
    """How many e-stops arrived, how long they took from the first step, and what the crowd cost."""
    with tempfile.TemporaryDirectory() as folder, board() as instrument:
        tokens = Path(folder, "tokens")
        tokens.touch(mode=0o600)
        tokens.write_text(f"observe {TOKEN}\n")
        api: dict[str, object] = {"token_file": str(tokens)}
        if tls is not None:
            api |= {"tls_certificate": str(tls / "cert.pem"), "tls_key": str(tls / "key.pem")}
        with daemon(instrument.device, {"api": api}) as running:
            _wait_until_it_listens(running.port)
            context = None if tls is None else ssl.create_default_context(cafile=str(tls / "cert.pem"))
            return asyncio.run(_measure(running, per_s, estops, context))


def _wait_until_it_listens(port: int) -> None:
    until_s = time.monotonic() + READY_WITHIN_S
    while time.monotonic() < until_s:
        with contextlib.suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port)):
            return
        time.sleep(0.1)


async def _measure(running: Daemon, per_s: int, estops: int, tls: ssl.SSLContext | None) -> Outcome:
    waiting = [await _FarClient.connect(running.port, number, tls) for number in range(8)]
    for client in waiting:
        await client.ask("authenticate", token=TOKEN)
    before_mb, cpu_s, began_s = running.resident_mb(), running.cpu_s(), time.monotonic()
    crowd = multiprocessing.Process(target=_crowd, args=(running.port, per_s), daemon=True)
    crowd.start()
    await asyncio.sleep(4.0)
    took_s, failed = [], list[str]()
    for number in range(estops):
        asked_s = time.monotonic()
        try:
            async with asyncio.timeout(ANSWER_S):
                await _come_and_stop(running.port, number, tls)
            took_s.append(time.monotonic() - asked_s)
        except (OSError, EOFError, AssertionError, TimeoutError) as problem:
            failed.append(f"e-stop {number}: {problem!r}")
    for client in waiting:
        try:
            async with asyncio.timeout(ANSWER_S):
                await client.ask("estop", reason="button")
        except (OSError, EOFError, AssertionError, TimeoutError) as problem:
            failed.append(f"e-stop of one that waited: {problem!r}")
    cpu = (running.cpu_s() - cpu_s) / (time.monotonic() - began_s)
    grown_mb = running.resident_mb() - before_mb
    crowd.terminate()
    figures = (
        Figure("e-stops step by step that did not arrive", len(failed), "", 0),
        Figure("of four steps p50", percentile(took_s, 50) * 1e3, "ms"),
        Figure("of four steps worst", max(took_s, default=0.0) * 1e3, "ms"),
        Figure("processor", cpu * 100, "%"),
        Figure("memory grown", grown_mb, "MB"),
    )
    return Outcome(figures, (f"{estops} e-stops, {per_s} connections a second",), tuple(failed[:5]))


async def _come_and_stop(port: int, number: int, tls: ssl.SSLContext | None) -> None:
    client = await _FarClient.connect(port, number, tls)
    try:
        await client.ask("authenticate", token=TOKEN)
        await client.ask("estop", reason="smoke")
    finally:
        client.close()


class _FarClient:
    """Each of its messages is 20 ms on its way, and so is each answer."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    @classmethod
    async def connect(cls, port: int, number: int, tls: ssl.SSLContext | None) -> "_FarClient":
        """Connect from one of six addresses, of which four are the crowd's, and wait for the greeting."""
        await asyncio.sleep(2 * AWAY_S * (1 if tls is None else 2))
        host = f"127.0.0.{1 + number % (ADDRESSES + 2)}"
        reader, writer = await asyncio.open_connection(
            "127.0.0.1",
            port,
            local_addr=(host, 0),
            limit=1 << 20,
            ssl=tls,
            server_hostname=None if tls is None else "localhost",
        )
        client = cls(reader, writer)
        await client.read()
        return client

    async def read(self) -> dict[str, object]:
        """The next message."""
        line = await self._reader.readline()
        await asyncio.sleep(AWAY_S)
        if not line:
            raise EOFError("the connection was closed")
        message: dict[str, object] = json.loads(line)
        return message

    async def ask(self, method: str, **params: object) -> None:
        """Send a request, and wait until it was answered with a result."""
        await asyncio.sleep(AWAY_S)
        self._writer.write(
            json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode() + b"\n"
        )
        answer = await self.read()
        if "result" not in answer:
            raise EOFError(str(answer))

    def close(self) -> None:
        """Close at once."""
        self._writer.transport.abort()


def _crowd(port: int, per_s: int) -> None:
    """Connect so often, in a process of its own, until it is ended."""
    held: deque[socket.socket] = deque()
    began_s, made = time.monotonic(), 0
    while True:
        while made < (time.monotonic() - began_s) * per_s:
            client = socket.socket()
            client.setblocking(False)
            client.bind((f"127.0.0.{1 + made % ADDRESSES}", 0))
            with contextlib.suppress(BlockingIOError):
                client.connect(("127.0.0.1", port))
            held.append(client)
            made += 1
            if len(held) > HELD:
                held.popleft().close()
        time.sleep(0.002)


def main() -> int:
    """Print the figures; exit code 1 where an e-stop did not arrive."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="20 e-stops")
    parser.add_argument("--per-s", type=int, default=1000)
    parser.add_argument("--estops", type=int, default=200)
    parser.add_argument("--tls", type=Path, help="a folder with cert.pem, for localhost, and key.pem")
    options = parser.parse_args()
    outcome = run(options.per_s, 20 if options.quick else options.estops, options.tls)
    Console().print(table({"crowd": outcome}))
    sys.stderr.write("".join(f"{line}\n" for line in (*outcome.remarks, *outcome.faults)))
    return bool(outcome.faults)


if __name__ == "__main__":
    sys.exit(main())
