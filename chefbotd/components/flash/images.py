"""The firmware images that come with chefbotd. ``make images`` builds them, the same bytes each time."""

import hashlib
from pathlib import Path

import msgspec

from chefbotd.components.flash.boards import Board
from chefbotd.core.record import Record
from chefbotd.packaged import find_packaged
from chefbotd.storage import explain

LIST = "images.json"
MOST_BYTES = 1 << 20
"""More than any of the boards has."""


class BadImageError(Exception):
    """An image that is missing, or not the one that was built; the message says which."""


class Image(Record, frozen=True):
    """A program for a board. ``version`` is that of the firmware; empty for a file of the user's own."""

    path: Path
    version: str = ""


def own_image(path: Path, board: Board) -> Image:
    """A file of the user's own.

    Raises:
        BadImageError: it cannot be a program of this board.
    """
    try:
        data = path.read_bytes()
        if path.suffix == ".hex":
            data = _from_hex(data)
    except OSError as error:
        raise BadImageError(f"{path}: {explain(error)}") from error
    except ValueError as error:
        raise BadImageError(f"{path}: is no Intel hex file: {error}") from error
    if len(data) > board.kept_bytes:
        raise BadImageError(
            f"{path}: is too large: the {board.title} has {board.kept_bytes} bytes for a program"
        )
    if not board.is_start(data):
        raise BadImageError(
            f"{path}: does not begin as a program of the {board.title} does: it is not written"
        )
    return Image(path)


def _from_hex(text: bytes) -> bytes:
    """The bytes from address 0 to the last one, 0xFF where there are none; raises ValueError."""
    bytes_at: dict[int, int] = {}
    base = 0
    for number, line in enumerate(text.decode("ascii").split(), 1):
        record = bytes.fromhex(line[1:])
        if line[0] != ":" or len(record) < 5 or len(record) != record[0] + 5 or sum(record) % 256:
            raise ValueError(f"line {number}: {line[:50]!r}")
        address, kind, data = int.from_bytes(record[1:3], "big"), record[3], record[4:-1]
        if kind == 1:
            break
        if kind in (2, 4):
            base = int.from_bytes(data, "big") << (4 if kind == 2 else 16)
        elif kind == 0:
            bytes_at |= {base + address + at: byte for at, byte in enumerate(data)}
    else:
        raise ValueError("it has no end")
    top = max(bytes_at, default=-1) + 1
    if top > MOST_BYTES:
        raise ValueError(f"it has bytes at {top:#x}")
    return bytes([bytes_at.get(at, 0xFF) for at in range(top)])


class _Listed(msgspec.Struct, frozen=True):
    file: str
    sha256: str


class _Images(msgspec.Struct, frozen=True):
    version: str
    boards: dict[str, _Listed]


def packaged_folder() -> Path:
    """The folder of images."""
    return find_packaged("firmware_images", "firmware/images")


def packaged_image(board: str, folder: Path | None = None) -> Image:
    """The image for a board of this name in ``images.json``.

    Raises:
        BadImageError: it is not there, or its bytes are not those that were built.
    """
    folder = folder or packaged_folder()
    try:
        images = msgspec.json.decode((folder / LIST).read_bytes(), type=_Images)
        listed = images.boards[board]
        data = (folder / listed.file).read_bytes()
    except OSError as error:
        raise BadImageError(f"{error.filename}: {error.strerror}") from error
    except ValueError as error:
        raise BadImageError(f"{folder / LIST}: {error}") from error
    except KeyError:
        raise BadImageError(f"{folder / LIST}: lists no image for {board}") from None
    digest = hashlib.sha256(data).hexdigest()
    if digest != listed.sha256:
        raise BadImageError(
            f"{folder / listed.file}: is damaged: its SHA-256 is {digest}, and {listed.sha256} was built"
        )
    return Image((folder / listed.file).resolve(), images.version)
