"""Pictures for tests: small JPEGs of one colour."""

import io
from functools import cache

from PIL import Image


@cache
def picture(grey: int = 128, width_px: int = 32, height_px: int = 24) -> bytes:
    """A picture of one grey, by Pillow with the standard Huffman tables."""
    data = io.BytesIO()
    Image.new("RGB", (width_px, height_px), (grey, grey, grey)).save(data, "JPEG", quality=90)
    return data.getvalue()


def without_tables(jpeg: bytes) -> bytes:
    """The picture as a webcam sends it: each segment of the head but the Huffman tables."""
    kept, place = bytearray(jpeg[:2]), 2
    while jpeg[place + 1] != 0xDA:
        end = place + 2 + int.from_bytes(jpeg[place + 2 : place + 4], "big")
        if jpeg[place + 1] != 0xC4:
            kept += jpeg[place:end]
        place = end
    return bytes(kept + jpeg[place:])
