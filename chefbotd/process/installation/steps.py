"""The kinds of installation steps: each reports what it does, or that nothing is to do."""

import os
import shutil
import stat
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

from msgspec import Struct

LONGEST_S = 90.0
"""``systemctl start`` waits until the daemon is ready."""


class InstallError(Exception):
    """The installation cannot go on; the text is ready to be shown."""


class CommandEnded(Struct, frozen=True):
    """The result of a command: its exit code and its output."""

    code: int
    output: str = ""


Run = Callable[[tuple[str, ...]], CommandEnded]


def run_command(command: tuple[str, ...]) -> CommandEnded:
    """Run a program of the system to its end."""
    try:
        done = subprocess.run(  # noqa: S603 - the commands are our own
            command, capture_output=True, text=True, timeout=LONGEST_S, check=False, stdin=subprocess.DEVNULL
        )
    except FileNotFoundError:
        return CommandEnded(127, f"there is no program {command[0]}")
    except subprocess.TimeoutExpired:
        return CommandEnded(124, f"it took longer than {LONGEST_S:g} s")
    return CommandEnded(done.returncode, (done.stdout + done.stderr).strip())


class Host:
    """``root`` is / on the running system; in any other folder nothing is started, and no device is asked for.

    ``run`` runs programs; ``chown`` gives a path to a user and a group by their names.
    """

    def __init__(
        self,
        root: Path = Path("/"),
        run: Run = run_command,
        chown: Callable[[Path, str, str], None] | None = None,
    ) -> None:
        self.root, self._run = root, run
        self._chown = chown or self._give

    @property
    def is_running(self) -> bool:
        """Whether this is the running system."""
        return self.root == Path("/")

    @property
    def has_systemd(self) -> bool:
        """Whether systemd runs it: in a container or a chroot its commands answer 0, and do nothing."""
        return self.is_running and self.path("/run/systemd/system").exists()

    def path(self, name: str) -> Path:
        """A path of the system, below ``root``."""
        return self.root / name.removeprefix("/")

    def ask(self, *command: str) -> bool:
        """Run a command, and tell whether its exit code is 0."""
        return self._run(command).code == 0

    def run(self, *command: str) -> None:
        """Run a command that must not fail.

        Raises:
            InstallError: it failed; the text contains its output.
        """
        ended = self._run(command)
        if ended.code:
            raise InstallError(f"'{' '.join(command)}' failed with {ended.code}: {ended.output}")

    def give(self, path: Path, user: str, group: str) -> None:
        """Give a path to a user and a group."""
        self._chown(path, user, group)

    def owner(self, path: Path) -> str:
        """The name of a path's owner in this system's list of users, or the number if the list lacks it."""
        number = str(path.stat().st_uid)
        names = [fields[0] for fields in self._fields("/etc/passwd") if fields[2] == number]
        return names[0] if names else "root" if number == "0" else number

    def has_user(self, name: str) -> bool:
        """Whether a user of this name exists."""
        return any(fields[0] == name for fields in self._fields("/etc/passwd"))

    def is_in_group(self, user: str, group: str) -> bool:
        """Whether a user is a member of a group."""
        members = [fields[3].split(",") for fields in self._fields("/etc/group") if fields[0] == group]
        return any(user in names for names in members)

    def _fields(self, file: str) -> list[list[str]]:
        try:
            lines = self.path(file).read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            return []
        return [fields for fields in (line.split(":") for line in lines) if len(fields) >= 4]

    def _give(self, path: Path, user: str, group: str) -> None:
        """Change the owner, by the numbers that these names have in this system (not in the running one)."""
        numbers = self._number("/etc/passwd", user), self._number("/etc/group", group)
        os.chown(path, *numbers, follow_symlinks=False)

    def _number(self, file: str, name: str) -> int:
        if name == "root":
            return 0
        number = next((fields[2] for fields in self._fields(file) if fields[0] == name), None)
        if number is None:
            raise LookupError(f"there is no {name} in {self.path(file)}")
        return int(number)


FILE_MODE = 0o644


class InstallationStep(Struct, frozen=True):
    """``told`` describes the step; ``act`` does it (None: it is done already, or not needed)."""

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
    refuse_link(path)
    right = path.is_dir() and stat.S_IMODE(path.stat().st_mode) == mode and _has_owner(host, path, owner)
    if right:
        return InstallationStep(f"{name}: unchanged")

    def make() -> None:
        path.mkdir(parents=True, exist_ok=True)
        refuse_link(path)
        path.chmod(mode)
        host.give(path, owner, owner)

    verb = "set mode and owner of" if path.is_dir() else "create"
    return InstallationStep(f"{verb} {name} ({mode:04o}, {owner})", make)


def refuse_link(path: Path) -> None:
    """Raise ``InstallError`` for a symbolic link: who is given it, or its mode, is given what it leads to."""
    if path.is_symlink():
        raise InstallError(
            f"{path} is a symbolic link to {path.readlink()}: remove it, or mount a folder there"
        )


def file(host: Host, name: str, text: str) -> InstallationStep:
    """Write a file with this text, owned by root."""
    path = host.path(name)
    if not path.is_symlink() and _reads(path) == text and stat.S_IMODE(path.stat().st_mode) == FILE_MODE:
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
