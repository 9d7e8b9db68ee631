"""Damage to a recording where it hurts."""

import io

from mcap.reader import make_reader


def damaged_chunk(data: bytes) -> bytes:
    """The file with one other bit in the middle of its middle chunk."""
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    changed = bytearray(data)
    changed[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0x10
    return bytes(changed)
