"""Writes into a built program how long its image is, and its CRC: ``core/image.c`` looks at them at each start.

Usage: python3 seal_image.py OBJCOPY PROGRAM.elf [SECTION...]

The CRC is CRC-16/IBM-3740 of the image as the flash has it, from address 0, with zeros in the place of the CRC.
"""

import subprocess
import sys
import tempfile
from binascii import crc_hqx
from pathlib import Path

MARK = b"\xc5image\x5c\xa3"
LENGTH_BYTES, CRC_BYTES = 4, 2


def image_of(objcopy: str, program: Path, sections: list[str]) -> bytes:
    """The bytes that go into the flash."""
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "image.bin"
        chosen = [argument for section in sections for argument in ("-j", section)]
        subprocess.run([objcopy, "-O", "binary", *chosen, str(program), str(raw)], check=True)  # noqa: S603 - as make says
        return raw.read_bytes()


def seal(image: bytes) -> bytes:
    """The length and the CRC of an image that has its mark once."""
    if image.count(MARK) != 1:
        raise ValueError(f"expected the mark once in the image, found it {image.count(MARK)} times")
    at = image.index(MARK) + len(MARK)
    length = len(image).to_bytes(LENGTH_BYTES, "little")
    whole = image[:at] + length + bytes(CRC_BYTES) + image[at + LENGTH_BYTES + CRC_BYTES :]
    return length + crc_hqx(whole, 0xFFFF).to_bytes(CRC_BYTES, "little")


def main(objcopy: str, name: str, *sections: str) -> None:
    """Seal a program in place."""
    program = Path(name)
    data = program.read_bytes()
    sealed = seal(image_of(objcopy, program, list(sections)))
    if data.count(MARK) != 1:
        raise ValueError(f"{program}: expected the mark once, found it {data.count(MARK)} times")
    at = data.index(MARK) + len(MARK)
    program.write_bytes(data[:at] + sealed + data[at + len(sealed) :])


if __name__ == "__main__":
    main(*sys.argv[1:])
