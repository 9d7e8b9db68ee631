"""Which configuration the doctor compares with: the one that is given, or the running daemon's, or the service's."""

import re
from pathlib import Path

from chefbotd.core.record import Record

PROC = Path("/proc")


class RunningDaemon(Record, frozen=True):
    """A ``chefbotd run`` on this computer, by its command line."""

    pid: int
    config: str = ""
    listen: str = ""


def running_daemons(proc: Path = PROC) -> list[RunningDaemon]:
    """Every one that we may see."""
    found = []
    for entry in proc.iterdir():
        words = _command_line(entry) if entry.name.isdecimal() else []
        if "run" in words and any(
            Path(word).name in ("chefbotd", "chefbotd.py") or _is_module(word) for word in words
        ):
            found.append(
                RunningDaemon(
                    int(entry.name), _value_of("--config", words, entry), _value_of("--listen", words, entry)
                )
            )
    return sorted(found, key=lambda daemon: daemon.pid)


def _is_module(word: str) -> bool:
    return word.startswith("chefbotd.cli.programs")


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
