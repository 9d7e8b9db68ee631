"""The kinds of installation steps: each reports what it does, or that nothing is to do."""

import os
import shutil
import stat
from collections.abc import Callable, Iterable
from pathlib import Path

from msgspec import Struct

from chefbotd.process.installation.host import Host, InstallError

FILE_MODE = 0o644


class InstallationStep(Struct, frozen=True):
    """``told`` is what is done, in words; ``act`` does it (None: it is done already, or not wanted)."""

    told: str
    act: Callable[[], None] | None = None


def carry_out(steps: Iterable[InstallationStep], tell: Callable[[InstallationStep], None]) -> None:
    """Tell and do each step in turn.

    Raises:
        InstallError: one has failed; those after it are not done.
    """
    for step in steps:
        tell(step)
        if step.act is None:
            continue
        try:
            step.act()
        except (OSError, LookupError) as error:
            raise InstallError(f"{step.told}: {error}") from error


def folder(host: Host, name: str, mode: int, owner: str = "root") -> InstallationStep:
    """A folder with this mode and owner; what is in it stays."""
    path = host.path(name)
    right = path.is_dir() and stat.S_IMODE(path.stat().st_mode) == mode and _has_owner(host, path, owner)
    if right:
        return InstallationStep(f"{name}: unchanged")

    def make() -> None:
        path.mkdir(parents=True, exist_ok=True)
        path.chmod(mode)
        host.give(path, owner, owner)

    verb = "set mode and owner of" if path.is_dir() else "create"
    return InstallationStep(f"{verb} {name} ({mode:04o}, {owner})", make)


def file(host: Host, name: str, text: str) -> InstallationStep:
    """A file of root's with just this text, whatever it had before."""
    path = host.path(name)
    if _reads(path) == text and stat.S_IMODE(path.stat().st_mode) == FILE_MODE:
        return InstallationStep(f"{name}: unchanged")
    verb = "replace" if path.exists() else "write"
    return InstallationStep(f"{verb} {name}", lambda: write(host, path, text, FILE_MODE))


def write(host: Host, path: Path, text: str, mode: int) -> None:
    """Write a file as a whole, so that nobody ever sees a part of it, or a secret before its mode is set."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".{path.name}.new")
    new.unlink(missing_ok=True)
    with open(new, "x", encoding="utf-8", opener=lambda at, flags: os.open(at, flags, 0o600)) as stream:
        stream.write(text)
    new.chmod(mode)
    host.give(new, "root", "root")
    new.replace(path)


def remove(host: Host, name: str) -> InstallationStep:
    """A file or a folder with all that is in it, gone."""
    path = host.path(name)
    if not path.exists() and not path.is_symlink():
        return InstallationStep(f"{name}: not there")
    if path.is_dir() and not path.is_symlink():
        return InstallationStep(f"remove {name} and all that is in it", lambda: shutil.rmtree(path))
    return InstallationStep(f"remove {name}", path.unlink)


def command(host: Host, doing: str, *words: str) -> InstallationStep:
    """A command that must not fail."""
    return InstallationStep(f"{doing}: {' '.join(words)}", lambda: host.run(*words))


def _reads(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _has_owner(host: Host, path: Path, owner: str) -> bool:
    """A folder that is not the running system belongs to whoever makes it; the owner is set where that is possible."""
    return not host.is_running or host.owner(path) == owner
