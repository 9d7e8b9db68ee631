"""The image knows whether it is whole: a half-written flash, or one of two builds, says so and moves nothing."""

import random
import subprocess
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest

from chefbotd.components.simulation.simavr import IMAGE
from firmware_protocol.checked import crc_16
from tests.firmware import host, tools
from tests.firmware.emulator import Emulated, built
from tests.firmware.qemu import Qemu

PAGE_BYTES = 128
"""The ATmega328P's flash is written in pages of 64 words."""

MARK = b"\xc5image\x5c\xa3"
SAYS_SO = "Image damaged: flash the board again"


@cache
def image_of(elf: Path, objcopy: str) -> bytes:
    """What goes into the flash."""
    built()
    raw = elf.with_suffix(".raw")
    subprocess.run([objcopy, "-O", "binary", "-j", ".text", elf, raw], check=True)
    return raw.read_bytes()


def patched(elf: Path, objcopy: str, change: dict[int, bytes], folder: Path) -> Path:
    """The program with these bytes at these addresses of its flash."""
    data, image = elf.read_bytes(), image_of(elf, objcopy)
    assert data.count(image) == 1
    begin = data.index(image)
    for address, new in change.items():
        at = begin + address
        data = data[:at] + new + data[at + len(new) :]
    written = folder / "changed.elf"
    written.write_bytes(data)
    return written


def said(elf: Path) -> Emulated:
    """A board that was powered on with this program, after 0.3 s and a duty; a program that cannot run has stopped."""
    board = Emulated(image=str(elf), boot_s=0.0)
    with suppress(RuntimeError):
        board.run(0.2)
        board.write("s 90 90")
        board.run(0.1)
    return board


def test_a_whole_image_names_itself() -> None:
    """The emulated board's, and its build in the answer to `about` is the CRC that is in it."""
    built()
    image = image_of(tools.BUILD / IMAGE, "avr-objcopy")
    crc = int.from_bytes(image[image.index(MARK) + 12 :][:2], "little")
    board = Emulated(image=IMAGE)
    board.forget()
    board.seal("about")
    board.run(0.05)
    assert board.fields("about") == [["4", "12500", str(crc), "0"]]


@pytest.mark.parametrize("seed", range(8))
def test_a_flipped_bit_anywhere_is_found(seed: int, tmp_path: Path) -> None:
    """The board says so, or is silent where it cannot run: it never names itself, and no motor is driven."""
    built()
    luck = random.Random(seed)
    elf = tools.BUILD / IMAGE
    image = image_of(elf, "avr-objcopy")
    at = luck.randrange(len(image))
    board = said(patched(elf, "avr-objcopy", {at: bytes([image[at] ^ 1 << luck.randrange(8)])}, tmp_path))
    assert "firmware\t1" not in board.text
    assert board.duties == []


@pytest.mark.parametrize("seed", range(16))
def test_a_mix_of_two_builds_never_names_itself(seed: int, tmp_path: Path) -> None:
    """Each page of the flash is one of either build's: 16 mixes, as of a write that failed in the middle, or of two."""
    built()
    luck = random.Random(seed)
    elf, other = tools.BUILD / IMAGE, tools.BUILD / "atmega328p_hangs.elf"
    image, second = (image_of(path, "avr-objcopy") for path in (elf, other))
    pages = range(0, min(len(image), len(second)) - PAGE_BYTES, PAGE_BYTES)
    chosen = (
        [page for page in pages if luck.random() < 0.5]
        if seed % 2
        else list(pages[luck.randrange(1, len(pages)) :])
    )
    change = {
        page: second[page : page + PAGE_BYTES]
        for page in chosen
        if second[page:][:PAGE_BYTES] != image[page:][:PAGE_BYTES]
    }
    assert change
    board = said(patched(elf, "avr-objcopy", change, tmp_path))
    assert "firmware\t1" not in board.text
    assert board.duties == []


def test_what_is_not_whole_is_said_again_and_again(tmp_path: Path) -> None:
    """About once a second, on the serial line, with the motors off: a text of the classic wire."""
    built()
    elf = tools.BUILD / IMAGE
    image = image_of(elf, "avr-objcopy")
    at = image.index(b"Reset Done")
    board = said(patched(elf, "avr-objcopy", {at: b"x"}, tmp_path))
    board.run(3.0)
    assert set(board.lines) == {SAYS_SO}
    assert 3 <= len(board.lines) <= 4
    assert (board.board.duty, board.duties) == ((0, 0), [])


def test_the_other_boards_image_says_so_too(tmp_path: Path) -> None:
    """In QEMU, the Stellaris build: the Tiva's has the same core and start."""
    built()
    tools.need("qemu-system-arm")
    elf = tools.BUILD / "lm3s6965.elf"
    image = image_of(elf, "arm-none-eabi-objcopy")
    board = Qemu(str(patched(elf, "arm-none-eabi-objcopy", {image.index(b"Reset Done"): b"x"}, tmp_path)))
    try:
        board.wait_for(SAYS_SO)
    finally:
        board.close()


def test_about_is_answered_in_both_modes_with_the_counts_that_were_set(board: host.Board) -> None:
    """All four edges, the most of them a second, the build, and what `g 0` set; without a seal it is refused."""
    board.forget()
    board.seal("about")
    assert board.bodies() == [["about", "4", "100000", "0", "0"]]
    board.hello()
    board.seal("g 0 8400")
    board.forget()
    board.seal("about")
    assert board.bodies() == [["about", "4", "100000", "0", "8400"]]
    board.forget()
    board.write("about")
    assert board.sent == []
    assert crc_16(b"123456789") == 0x29B1
