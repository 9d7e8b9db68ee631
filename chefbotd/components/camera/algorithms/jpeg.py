"""JPEG pictures as bytes: whether one is whole, its size, and the tables that a webcam leaves out. Nothing is decoded.

Markers are those of ITU-T T.81, table B.1. Motion JPEG of webcams often lacks the Huffman tables, because all use those
of T.81, annex K.3; browsers cannot show such a picture, so they are put in.
"""

from typing import Final

from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence

START: Final = b"\xff\xd8"
END: Final = b"\xff\xd9"
START_OF_SCAN: Final = 0xDA
HUFFMAN_TABLE: Final = 0xC4
FRAME_HEADS: Final = frozenset({0xC0, 0xC1, 0xC2, 0xC3})
MOST_PADDING_BYTES: Final = 4096
"""Zeros that a driver may leave behind a picture (assumed); what is longer is searched no further."""


class NotAPicture(ValueError):
    """Bytes that are no whole JPEG picture; the text says why."""

    @property
    def words(self) -> str:
        """Why, with its id where it has one."""
        return str(self) if not self.args else self.args[0]


class Picture(Record, frozen=True):
    """A whole JPEG picture, and its size in pixels."""

    jpeg: bytes
    width_px: int
    height_px: int


class _Head(Record, frozen=True):
    """What stands before a picture's data, which begins at ``scan``."""

    width_px: int
    height_px: int
    has_tables: bool
    scan: int


def read_picture(data: bytes, most_bytes: int) -> Picture:
    """The picture in ``data``, without what a driver leaves behind its end, and with Huffman tables.

    Raises:
        NotAPicture: it is cut, too long, or no JPEG.
    """
    if not data.startswith(START):
        raise NotAPicture(Sentence("camera.not_jpeg", "it does not begin as a JPEG does"))
    end = data.rfind(END, max(len(data) - MOST_PADDING_BYTES, 0))
    if end < 0:
        raise NotAPicture(Sentence("camera.cut", "it is cut: its end is missing"))
    jpeg = data if end + 2 == len(data) else data[: end + 2]
    head = _read_head(jpeg)
    if not head.has_tables:
        jpeg = b"".join((jpeg[: head.scan], STANDARD_TABLES, jpeg[head.scan :]))
    if len(jpeg) > most_bytes:
        raise NotAPicture(
            Sentence(
                "camera.too_long",
                "it has {size} bytes, and at most {most_bytes} are passed on",
                size=len(jpeg),
                most_bytes=most_bytes,
            )
        )
    return Picture(jpeg, head.width_px, head.height_px)


def _read_head(jpeg: bytes) -> _Head:
    width = height = 0
    has_tables = False
    place = len(START)
    while place + 4 <= len(jpeg):
        if jpeg[place] != 0xFF:
            raise NotAPicture("its head is damaged")
        marker, length = jpeg[place + 1], int.from_bytes(jpeg[place + 2 : place + 4], "big")
        if marker == 0xFF:  # a fill byte
            place += 1
            continue
        if marker == START_OF_SCAN:
            if not width or not height:
                raise NotAPicture("its head does not say how large it is")
            return _Head(width, height, has_tables, place)
        if marker in FRAME_HEADS and place + 9 <= len(jpeg):
            height = int.from_bytes(jpeg[place + 5 : place + 7], "big")
            width = int.from_bytes(jpeg[place + 7 : place + 9], "big")
        has_tables |= marker == HUFFMAN_TABLE
        place += 2 + length
    raise NotAPicture("it is cut in its head")


def _table(kind: int, counts: bytes, values: bytes) -> bytes:
    """A segment with one Huffman table (T.81, B.2.4.2): how many codes of each length, and what they stand for."""
    body = bytes((kind,)) + counts + values
    return bytes((0xFF, HUFFMAN_TABLE)) + (2 + len(body)).to_bytes(2, "big") + body


_DC_VALUES: Final = bytes(range(12))
_LUMINANCE_AC: Final = bytes.fromhex(
    "01020300041105122131410613516107227114328191a1082342b1c11552d1f02433627282090a161718191a25262728292a3435363738393a"
    "434445464748494a535455565758595a636465666768696a737475767778797a838485868788898a92939495969798999aa2a3a4a5a6a7a8a9"
    "aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9fa"
)
_CHROMINANCE_AC: Final = bytes.fromhex(
    "0001020311040521310612415107617113223281081442"
    "91a1b1c109233352f0156272d10a162434e125f11718191a262728292a35363738393a434445464748494a535455565758595a636465666768"
    "696a737475767778797a82838485868788898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3"
    "d4d5d6d7d8d9dae2e3e4e5e6e7e8e9eaf2f3f4f5f6f7f8f9fa"
)
STANDARD_TABLES: Final = (
    _table(0x00, bytes((0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0)), _DC_VALUES)
    + _table(0x10, bytes((0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7D)), _LUMINANCE_AC)
    + _table(0x01, bytes((0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0)), _DC_VALUES)
    + _table(0x11, bytes((0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77)), _CHROMINANCE_AC)
)
"""The typical tables of T.81, annex K.3."""
