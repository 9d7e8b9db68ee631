"""The images that come with chefbotd."""

import hashlib
import json
from pathlib import Path

import pytest

from chefbotd.components.flash.boards import DUEMILANOVE, TIVA, Board
from chefbotd.components.flash.images import LIST, BadImageError, own_image, packaged_folder, packaged_image


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An image for one board."""
    (tmp_path / "a.bin").write_bytes(b"program")
    listed = {"file": "a.bin", "sha256": hashlib.sha256(b"program").hexdigest()}
    (tmp_path / LIST).write_text(json.dumps({"version": "0.1", "boards": {"avr": listed}}))
    return tmp_path


def test_an_image_is_found_by_its_board(folder: Path) -> None:
    """With the version of the firmware."""
    image = packaged_image("avr", folder)
    assert (image.path, image.version) == (folder / "a.bin", "0.1")


def test_a_damaged_image_is_refused(folder: Path) -> None:
    """One byte is enough."""
    (folder / "a.bin").write_bytes(b"prograM")
    with pytest.raises(BadImageError, match=r"a\.bin: is damaged: its SHA-256 is [0-9a-f]{64}, and"):
        packaged_image("avr", folder)


def test_what_is_missing_is_named(folder: Path) -> None:
    """A board without an image, a file that is gone, a list that is none."""
    with pytest.raises(BadImageError, match="lists no image for arm"):
        packaged_image("arm", folder)
    (folder / "a.bin").unlink()
    with pytest.raises(BadImageError, match=r"a\.bin: No such file"):
        packaged_image("avr", folder)
    (folder / LIST).write_text('{"version": 1}')
    with pytest.raises(BadImageError, match=r"images\.json: Expected `str`"):
        packaged_image("avr", folder)


FOR_AVR = b"\x0c\x94\x34\x00" + b"\x00" * 60
"""`jmp 0x68`."""

FOR_CORTEX = (0x2000_8000).to_bytes(4, "little") + (0x101).to_bytes(4, "little") + b"\x00" * 60


@pytest.mark.parametrize(("board", "data"), [(DUEMILANOVE, FOR_AVR), (TIVA, FOR_CORTEX)])
def test_a_program_of_the_boards_processor_is_taken(board: Board, data: bytes, tmp_path: Path) -> None:
    """By its vectors, as they begin every program; those that come with chefbotd are taken too."""
    file = tmp_path / "own.bin"
    file.write_bytes(data)
    assert own_image(file, board).path == file
    assert own_image(packaged_image(board.image, packaged_folder()).path, board)


@pytest.mark.parametrize(
    ("board", "name", "data", "why"),
    [
        (DUEMILANOVE, "empty.bin", b"", "does not begin as a program of the Arduino"),
        (DUEMILANOVE, "text.bin", b"dear board", "does not begin"),
        (DUEMILANOVE, "other.bin", FOR_CORTEX, "does not begin"),
        (TIVA, "other.bin", FOR_AVR, "does not begin as a program of the Tiva"),
        (TIVA, "short.bin", FOR_CORTEX[:4], "does not begin"),
        (DUEMILANOVE, "large.bin", FOR_AVR.ljust(0x7801, b"\x01"), "is too large: .* 30720 bytes"),
        (DUEMILANOVE, "text.hex", b"dear board", "is no Intel hex file"),
        (DUEMILANOVE, "empty.hex", b"", "is no Intel hex file: it has no end"),
        (DUEMILANOVE, "cut.hex", b":040000000C943400\n", "is no Intel hex file: line 1"),
        (DUEMILANOVE, "endless.hex", b":040000000C94340028\n", "is no Intel hex file: it has no end"),
        (DUEMILANOVE, "damaged.hex", b":040000000D94340028\n:00000001FF\n", "is no Intel hex file: line 1"),
        (DUEMILANOVE, "far.hex", b":02000004FFFFFC\n:0100000000FF\n:00000001FF\n", "bytes at 0xffff0001"),
    ],
)
def test_what_cannot_be_a_program_of_the_board_is_not_written(
    board: Board, name: str, data: bytes, why: str, tmp_path: Path
) -> None:
    """The board would hold nonsense, or half a program where it is too large."""
    file = tmp_path / name
    file.write_bytes(data)
    with pytest.raises(BadImageError, match=why):
        own_image(file, board)
