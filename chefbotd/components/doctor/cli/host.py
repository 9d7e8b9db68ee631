"""What this computer tells: its ports, governor, clock, service and the daemons that run. Changes nothing."""

import asyncio
import contextlib
import os
import re
import signal
from collections.abc import Mapping
from pathlib import Path

from chefbotd.child import send_signal
from chefbotd.components.doctor.algorithms.host import PortFound
from chefbotd.components.doctor.listening.ports import holder, permission_problem
from chefbotd.core.record import Record
from chefbotd.link.cannot_open import owners_of, ports_there
from chefbotd.link.port import LinkParameters

CPUS = Path("/sys/devices/system/cpu")
RUNS_SYSTEMD = Path("/run/systemd/system")
PATIENCE_S = 5.0
UNIT = "chefbotd.service"
PROPERTIES = "LoadState,ActiveState,UnitFileState,Result,ExecMainStatus,NRestarts,FragmentPath,ExecStart"


def look_at_port(link: LinkParameters) -> PortFound:
    """The board's device before it is opened."""
    device = link.device
    if "://" in device:
        return PortFound(device, exists=True, is_socket=True)
    if not Path(device).exists():
        return PortFound(device, exists=False, others=ports_there())
    return PortFound(device, exists=True, permission=permission_problem(device), held_by=holder(device))


def governors(cpus: Path = CPUS) -> list[str]:
    """The governor of each processor."""
    names = []
    for path in sorted(cpus.glob("cpu[0-9]*/cpufreq/scaling_governor")):
        with contextlib.suppress(OSError):
            names.append(path.read_text().strip())
    return names


async def command_output(*command: str) -> str | None:
    """What a program prints; None where there is no such program, or it fails or hangs."""
    try:
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )
    except OSError:
        return None
    try:
        async with asyncio.timeout(PATIENCE_S):
            output, _ = await process.communicate()
    except TimeoutError:
        send_signal(process, signal.SIGKILL)
        await process.wait()
        return None
    return output.decode(errors="replace") if process.returncode == 0 else None


async def is_synchronized() -> bool | None:
    """Whether the computer's clock is kept right; None where nothing tells."""
    answer = await command_output("timedatectl", "show", "--property=NTPSynchronized", "--value")
    return None if answer is None else answer.strip() == "yes"


async def service_unit() -> Mapping[str, str] | None:
    """The unit's properties; None where systemd does not run."""
    if not _runs_systemd():
        return None
    answer = await command_output("systemctl", "show", UNIT, f"--property={PROPERTIES}")
    if answer is None:
        return None
    return dict(line.split("=", 1) for line in answer.splitlines() if "=" in line)


PROC = Path("/proc")


class RunningDaemon(Record, frozen=True):
    """A ``chefbotd run`` on this computer, by its command line."""

    pid: int
    config: str = ""
    listen: str = ""


def running_daemons(proc: Path = PROC) -> list[RunningDaemon]:
    """Every one that we may see."""
    daemons = []
    for entry in proc.iterdir():
        words = _command_line(entry) if entry.name.isdecimal() else []
        if "run" in words and any(
            Path(word).name in ("chefbotd", "chefbotd.py") or word.startswith("chefbotd.cli.programs")
            for word in words
        ):
            daemons.append(
                RunningDaemon(
                    int(entry.name), _value_of("--config", words, entry), _value_of("--listen", words, entry)
                )
            )
    return sorted(daemons, key=lambda daemon: daemon.pid)


def pid_at(port: int, device: str, proc: Path = PROC) -> int | None:
    """The daemon that answers at this port and has this device: by what it has open, or by its command line."""
    with contextlib.suppress(OSError):
        if len(holders := owners_of(device, proc)) == 1:
            return holders[0]
    daemons = running_daemons(proc)
    named = [daemon for daemon in daemons if daemon.listen.rpartition(":")[2] == str(port)]
    candidates = named or daemons
    return candidates[0].pid if len(candidates) == 1 else None


def priority_of(pid: int | None, proc: Path = PROC) -> tuple[int | None, int, int]:
    """A daemon's real-time priority (0: none), nice value and locked kilobytes; None, 0, 0 where there is no daemon."""
    if pid is None:
        return None, 0, 0
    try:
        policy, parameter = os.sched_getscheduler(pid), os.sched_getparam(pid)
        nice = os.getpriority(os.PRIO_PROCESS, pid)
        status = dict(line.split(":", 1) for line in (proc / str(pid) / "status").read_text().splitlines())
    except OSError:
        return None, 0, 0
    is_realtime = policy & ~os.SCHED_RESET_ON_FORK in (os.SCHED_FIFO, os.SCHED_RR)
    return parameter.sched_priority if is_realtime else 0, nice, int(status["VmLck"].split()[0])


def _command_line(entry: Path) -> list[str]:
    try:
        return (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def _value_of(option: str, words: list[str], entry: Path) -> str:
    """What an option says, a relative path from the program's own folder."""
    for word, after in zip(words, [*words[1:], ""], strict=True):
        if word == option or word.startswith(f"{option}="):
            value = word.partition("=")[2] or after
            try:
                beside = (entry / "cwd").resolve(strict=True) / value
            except OSError:
                return value
            return str(beside) if beside.is_file() else value
    return ""


def config_of_unit(exec_start: str) -> str:
    """The configuration in a unit's ``ExecStart``; empty where it names none."""
    match = re.search(r"--config[= ](\S+)", exec_start)
    return match.group(1) if match else ""


def _runs_systemd() -> bool:
    return RUNS_SYSTEMD.exists()
