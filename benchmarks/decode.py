"""How much longer decoding takes than merely splitting the same lines and converting their numbers.

``python benchmarks/decode.py [CAPTURE] [--json FILE]``: the capture is a file of raw bytes from a board; without
one, a classic robot's cycles are made up, the same ones each time. All sides run by turns in one process and the
medians are compared, so that the machine's speed cancels out.
"""

import argparse
import json
import math
import random
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from firmware_protocol.codec import CLASSIC, from_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import Banner, Malformed, ResetDone, Text

ROUNDS = 15
CYCLES = 3000
RECORDING_CHUNK_BYTES = 4096
USB_CHUNK_BYTES = 64  # a full-speed USB packet, the least that the board's driver hands over at a time
LIMIT = 3.0  # the most that decoding a recording may take, in units of the bare work

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


def decode(capture: bytes, chunk_bytes: int) -> None:
    """The real work, fed in pieces: cut, validate, build messages, count."""
    decoder = Decoder(from_board(CLASSIC))
    for start in range(0, len(capture), chunk_bytes):
        decoder.feed(capture[start : start + chunk_bytes])


SIDES: dict[str, Callable[[bytes], None]] = {
    "bare": bare,
    "decode": partial(decode, chunk_bytes=RECORDING_CHUNK_BYTES),
    "decode_usb": partial(decode, chunk_bytes=USB_CHUNK_BYTES),
}


def numeric_lines(capture: bytes) -> bytes:
    """The capture's well-formed lines of numbers: the ones that both sides can do."""
    decoded = Decoder(from_board(CLASSIC)).feed(capture)
    refused_or_text = Malformed | Text | Banner | ResetDone
    lines = [line for line, meaning in decoded if not isinstance(meaning, refused_or_text)]
    return b"\n".join([*lines, b""])


def _seconds(work: Callable[[bytes], None], capture: bytes) -> float:
    start_s = time.perf_counter()
    work(capture)
    return time.perf_counter() - start_s


def run(capture: bytes | None = None, rounds: int = ROUNDS) -> dict[str, Any]:
    """Time the sides by turns; nanoseconds a line and their ratios, by the medians.

    Raises:
        ValueError: the capture has no well-formed line of numbers.
    """
    capture = numeric_lines(made_up_capture() if capture is None else capture)
    lines = capture.count(b"\n")
    if not capture.strip():
        raise ValueError("the capture has no well-formed line of numbers")
    times: dict[str, list[float]] = {name: [] for name in SIDES}
    for _ in range(rounds):
        for name, work in SIDES.items():
            times[name].append(_seconds(work, capture))
    median_s = {name: statistics.median(each) for name, each in times.items()}
    return {
        "lines": lines,
        "bytes": len(capture),
        **{f"{name}_ns_per_line": each_s / lines * 1e9 for name, each_s in median_s.items()},
        "ratio": median_s["decode"] / median_s["bare"],
        "ratio_usb": median_s["decode_usb"] / median_s["bare"],
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
