"""The computer on which chefbotd is installed, or a folder that will become a computer's root."""

import os
import subprocess
from collections.abc import Callable
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
        os.chown(path, self._number("/etc/passwd", user), self._number("/etc/group", group))

    def _number(self, file: str, name: str) -> int:
        if name == "root":
            return 0
        number = next((fields[2] for fields in self._fields(file) if fields[0] == name), None)
        if number is None:
            raise LookupError(f"there is no {name} in {self.path(file)}")
        return int(number)
