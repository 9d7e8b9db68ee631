"""The file of those who were let in: a digest of each token, never the token."""

from pathlib import Path

import msgspec

from chefbotd.core.record import Record
from chefbotd.rpc.parameters import Role
from chefbotd.storage import read_file, replace_file

MOST_BYTES = 1 << 20
MOST_DEVICES = 256


class Device(Record, frozen=True):
    """A phone that was let in. ``expires_s`` is in seconds since 1970, None: its access ends when it is revoked."""

    number: int
    role: Role
    name: str
    token_sha256: str
    admitted_s: float
    expires_s: float | None = None

    @property
    def digest(self) -> bytes:
        """Of its token."""
        return bytes.fromhex(self.token_sha256)

    def is_valid(self, now_s: float) -> bool:
        """Whether its access has not expired; ``now_s`` is in seconds since 1970."""
        return self.expires_s is None or self.expires_s > now_s


class AccessList(Record, frozen=True):
    """All of them; ``count`` is how many there have ever been."""

    version: int = 1
    count: int = 0
    devices: tuple[Device, ...] = ()


class UnreadableAccess(Exception):
    """The file is damaged, or of another version; the text says which file."""


class AccessFile:
    """``path`` is written so that a kill leaves the old file or the new one."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> AccessList:
        """Who was let in; nobody where there is no file.

        Raises:
            OSError: it cannot be read.
            UnreadableAccess: it is no such file.
        """
        try:
            content = read_file(self._path, MOST_BYTES)
        except FileNotFoundError:
            return AccessList()
        try:
            access_list = msgspec.json.decode(content, type=AccessList)
            if access_list.version != 1 or any(len(device.digest) != 32 for device in access_list.devices):
                raise ValueError(f"version {access_list.version}")
        except ValueError as error:  # msgspec.ValidationError is one
            raise UnreadableAccess(f"{self._path}: is no list of those who were let in: {error}") from error
        return access_list

    def write(self, access_list: AccessList) -> None:
        """Replace the file.

        Raises:
            OSError: it cannot be written; the old one is there.
        """
        self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        replace_file(self._path, msgspec.json.encode(access_list))
