"""How much longer decoding takes than merely splitting the same lines and converting their numbers.

``python benchmarks/decode.py [CAPTURE] [--json FILE]``: the capture is a file of raw bytes from a board; without
one, a classic robot's cycles are made up, the same ones each time. The two sides run by turns in one process and
the medians are compared, so that the machine's speed cancels out.
"""

import argparse
import json
import math
import random
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from firmware_protocol.codec import CLASSIC, from_board
from firmware_protocol.decoder import Decoder

ROUNDS = 15
CYCLES = 3000
CHUNK_BYTES = 4096
LIMIT = 3.0  # the most that decoding may take, in units of the bare work

CONVERT = {b"t": float, b"e": int, b"u": int, b"s": float, b"i": float, b"b": float}


def made_up_capture(cycles: int = CYCLES, seed: int = 1) -> bytes:
    """A classic robot on a winding drive at 50 cycles a second, every value moving."""
    noise = random.Random(seed)
    micros, left, right = 1_000_000, 0, 0
    lines: list[str] = []
    for cycle in range(cycles):
        micros += 20_000 + noise.randrange(-50, 50)
        left += noise.randrange(70, 110)
        right += noise.randrange(80, 120)
        half_heading = cycle / 400
        lines += (
            f"t\t{micros}\t0.02",
            f"e\t{left}\t{right}",
            f"u\t{noise.randrange(5, 300)}",
            f"s\t{noise.randrange(80, 160)}.00\t{noise.randrange(80, 160)}.00",
            f"i\t0.01\t-0.02\t{math.sin(half_heading):.2f}\t{math.cos(half_heading):.2f}",
            f"b\t{noise.gauss(3000, 5):.2f}",
        )
    return "\n".join([*lines, ""]).encode()


def bare(capture: bytes) -> None:
    """The yardstick: split the lines and their fields, convert the numbers of the known kinds, keep nothing."""
    for line in capture.split(b"\n"):
        kind, *texts = line.split(b"\t")
        convert = CONVERT.get(kind)
        if convert is not None:
            for text in texts:
                convert(text)


def decode(capture: bytes) -> None:
    """The real work, fed in pieces as from a recording: validate, build messages, count."""
    decoder = Decoder(from_board(CLASSIC))
    for start in range(0, len(capture), CHUNK_BYTES):
        decoder.feed(capture[start : start + CHUNK_BYTES])


def _seconds(work: Callable[[bytes], None], capture: bytes) -> float:
    start_s = time.perf_counter()
    work(capture)
    return time.perf_counter() - start_s


def run(capture: bytes | None = None, rounds: int = ROUNDS) -> dict[str, Any]:
    """Time both sides by turns; nanoseconds a line and their ratio, by the medians."""
    capture = made_up_capture() if capture is None else capture
    lines = capture.count(b"\n")
    pairs = [(_seconds(bare, capture), _seconds(decode, capture)) for _ in range(rounds)]
    bare_s, decode_s = (statistics.median(times) for times in zip(*pairs, strict=True))
    return {
        "lines": lines,
        "bytes": len(capture),
        "bare_ns_per_line": bare_s / lines * 1e9,
        "decode_ns_per_line": decode_s / lines * 1e9,
        "ratio": decode_s / bare_s,
        "ratio_limit": LIMIT,
    }


def main() -> None:
    """Print the table; write the JSON where asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("capture", nargs="?", type=Path, help="raw bytes from a board")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    options = parser.parse_args()
    figures = run(options.capture.read_bytes() if options.capture else None)
    for name, value in figures.items():
        print(f"{name:20} {value:12,.2f}" if isinstance(value, float) else f"{name:20} {value:12,}")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
