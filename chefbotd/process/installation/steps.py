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
    """Report and do each step in turn.

    Raises:
        InstallError: a step failed; the later ones are not done.
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
    """Create a folder with this mode and owner, or set both; its content stays."""
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
    """Write a file with this text, owned by root."""
    path = host.path(name)
    if _reads(path) == text and stat.S_IMODE(path.stat().st_mode) == FILE_MODE:
        return InstallationStep(f"{name}: unchanged")
    verb = "replace" if path.exists() else "write"
    return InstallationStep(f"{verb} {name}", lambda: write(host, path, text, FILE_MODE))


def write(host: Host, path: Path, text: str, mode: int) -> None:
    """Replace a file atomically: nobody sees a part of it, or a secret before its mode is set."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".{path.name}.new")
    new.unlink(missing_ok=True)
    with open(new, "x", encoding="utf-8", opener=lambda at, flags: os.open(at, flags, 0o600)) as stream:
        stream.write(text)
    new.chmod(mode)
    host.give(new, "root", "root")
    new.replace(path)


def remove(host: Host, name: str) -> InstallationStep:
    """Remove a file, or a folder with its content."""
    path = host.path(name)
    if not path.exists() and not path.is_symlink():
        return InstallationStep(f"{name}: not there")
    if path.is_dir() and not path.is_symlink():
        return InstallationStep(f"remove {name} and all that is in it", lambda: shutil.rmtree(path))
    return InstallationStep(f"remove {name}", path.unlink)


def command(host: Host, doing: str, *words: str) -> InstallationStep:
    """Run a command that must not fail."""
    return InstallationStep(f"{doing}: {' '.join(words)}", lambda: host.run(*words))


def _reads(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _has_owner(host: Host, path: Path, owner: str) -> bool:
    """Set the owner. Outside the running system, a user who may not do this keeps the file."""
    return not host.is_running or host.owner(path) == owner
