"""The daemon under test: the real program in a process of its own, on a device, with a configuration in a file."""

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from benchmarks.rpc import Caller, CallFailed
from chefbotd.settings import packaged
from chefbotd.settings.loader import read_values
from chefbotd.transport.ports import reserve_port

CHEFBOTD = (str(Path(sys.executable).with_name("chefbotd")),)
READY_WITHIN_S = 10.0
Changes = Mapping[str, Mapping[str, Any] | list[Mapping[str, Any]]]


class NotReady(Exception):
    """The daemon did not come up, or did not get where it should; the text holds its log."""


@dataclass(frozen=True, slots=True)
class Daemon:
    """A running daemon, and when its process was started."""

    process: "subprocess.Popen[bytes]"
    port: int
    started_ns: int
    page_port: int = 0

    def cpu_s(self) -> float:
        """Processor seconds used so far, in user mode and in the kernel."""
        times = psutil.Process(self.process.pid).cpu_times()
        return float(times.user + times.system)

    def resident_mb(self) -> float:
        """Resident memory in units of 10^6 bytes."""
        return float(psutil.Process(self.process.pid).memory_info().rss) / 1e6


@contextmanager
def daemon(
    device: str, changes: Changes | None = None, program: Sequence[str] = CHEFBOTD
) -> Iterator[Daemon]:
    """``chefbotd run`` on a device; ``changes`` replace keys of the packaged configuration, section by section."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-bench-") as folder:
        config, port = Path(folder, "robot.toml"), reserve_port()
        config.write_text(to_toml(_changed(changes or {})))
        options = ["run", "--config", str(config), "--port", device, "--listen", f"127.0.0.1:{port}"]
        with running([*program, *options], port) as process:
            yield process


@contextmanager
def running(command: Sequence[str], port: int, page_port: int = 0) -> Iterator[Daemon]:
    """A daemon that serves these ports; the log of one that fails is in the error's note."""
    with (
        tempfile.NamedTemporaryFile(prefix="chefbotd-bench-", suffix=".log") as log,
        tempfile.TemporaryDirectory(prefix="chefbotd-bench-") as state,
    ):
        environment = {**os.environ, "XDG_STATE_HOME": state}
        started_ns = time.monotonic_ns()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=log, env=environment
        )
        try:
            yield Daemon(process, port, started_ns, page_port)
        except Exception as error:
            error.add_note(f"the daemon's log: {Path(log.name).read_text()}")
            raise
        finally:
            _end(process)


def connect(running: Daemon, within_s: float = READY_WITHIN_S) -> Caller:
    """A caller of a daemon whose link is up and whose gate is armed."""
    until(lambda: _listens(running), "the daemon does not listen", within_s)
    caller = Caller(running.port)
    until(lambda: caller.call("get_state")["link"]["state"] == "up", "the link does not come up", within_s)
    until(lambda: sent(caller, "arm"), "it cannot be armed", within_s)
    return caller


def until(is_so: Callable[[], bool], complaint: str, within_s: float = READY_WITHIN_S) -> None:
    """Wait until it is so; raises ``NotReady`` with the complaint after ``within_s``."""
    end_s = time.monotonic() + within_s
    while not is_so():
        if time.monotonic() > end_s:
            raise NotReady(complaint)
        time.sleep(0.01)


def to_toml(values: Mapping[str, Any], section: str = "") -> str:
    """TOML of nested tables, arrays of tables, and scalars (which JSON writes the same way)."""
    scalars = [f"{k} = {json.dumps(v)}" for k, v in values.items() if not _is_table(v)]
    lines = [f"[{section}]", *scalars] if section and (scalars or not values) else scalars
    for key, value in values.items():
        name = f"{section}.{key}" if section else key
        if isinstance(value, Mapping):
            lines.append(to_toml(value, name))
        elif _is_table(value):
            lines += [f"[[{name}]]\n{to_toml(row)}" for row in value]
    return "\n".join(lines)


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, list) and any(isinstance(v, Mapping) for v in value)
    )


def _changed(changes: Changes) -> dict[str, Any]:
    values = read_values(packaged())
    for section, keys in changes.items():
        values[section] = keys if isinstance(keys, list) else {**values.get(section, {}), **keys}
    return values


def sent(caller: Caller, method: str, **params: object) -> bool:
    """Whether a request was taken; on a busy machine it may be too old before it is read."""
    try:
        caller.call(method, **params)
    except CallFailed as error:
        if "send it again" not in str(error):
            raise
        return False
    return True


def _listens(running: Daemon) -> bool:
    if running.process.poll() is not None:
        raise NotReady(f"the daemon ended with exit code {running.process.returncode}")
    try:
        socket.create_connection(("127.0.0.1", running.port), timeout=1).close()
    except ConnectionRefusedError:
        return False
    return True


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    try:
        process.wait(timeout=5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
