"""Many subscribers in one process that only reads, and notes how old each event was when it arrived."""

import gc
import json
import multiprocessing
import select
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection

STAMP = b'"stamp_s":'


class Subscribers:
    """The parent's handle."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        pipe.recv()

    def forget(self) -> None:
        """Start counting from here."""
        self._pipe.send("forget")

    def latencies_s(self) -> list[float]:
        """From each event's ``stamp_s`` to its arrival, since the last ``forget``."""
        self._pipe.send("tell")
        told: list[float] = self._pipe.recv()
        return told


@contextmanager
def subscribers(port: int, count: int, topic: str) -> Iterator[Subscribers]:
    """A process with ``count`` connections, all subscribed to a topic without a rate limit."""
    processes = multiprocessing.get_context("fork")
    ours, theirs = processes.Pipe()
    process = processes.Process(target=_run, args=(theirs, port, count, topic), daemon=True)
    process.start()
    try:
        yield Subscribers(ours)
    finally:
        process.terminate()
        process.join()


def _run(pipe: Connection, port: int, count: int, topic: str) -> None:
    gc.disable()
    poll = select.epoll()
    poll.register(pipe, select.EPOLLIN)
    connections = {c.fileno(): c for c in (_subscribed(port, topic) for _ in range(count))}
    unread = dict.fromkeys(connections, b"")
    for number in connections:
        poll.register(number, select.EPOLLIN)
    latencies_s: list[float] = []
    pipe.send("ready")
    while True:
        for number, _ in poll.poll():
            if number in connections:
                data = connections[number].recv(65536)
                lines, _, unread[number] = (unread[number] + data).rpartition(b"\n")
                latencies_s += ages_s(lines, time.monotonic())
            elif pipe.recv() == "tell":
                pipe.send(latencies_s)
            else:
                latencies_s.clear()


def _subscribed(port: int, topic: str) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", port))
    params = {"topics": [topic], "policy": "ordered"}
    connection.sendall(
        json.dumps({"jsonrpc": "2.0", "method": "subscribe", "params": params}).encode() + b"\n"
    )
    return connection


def ages_s(lines: bytes, now_s: float) -> list[float]:
    """The age of each event among the lines; other lines have no stamp."""
    ages_s = []
    end = 0
    while (start := lines.find(STAMP, end)) >= 0:
        end = lines.index(b",", start)
        ages_s.append(now_s - float(lines[start + len(STAMP) : end]))
    return ages_s
