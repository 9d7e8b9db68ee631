"""Golden conversations with the firmware's core: ``python -m tests.firmware.conversations`` writes them anew.

They are in tests/vectors/firmware, a file each, a JSON object a line. The first has what it is ``about``, the board's
clock at the start (``micros``) and whether its ``imu`` answers; the board starts then with the cause 1 (power on).
Every other has ``at_us``, the microseconds since that start, never going back, and one of:

| key | meaning |
|---|---|
| `in` | bytes to the board, all at once; a pass of the main loop follows |
| `lost` | the UART loses so many bytes |
| `edges` | edges of each wheel, left and right, forward positive, all at once |
| `imu`, `battery`, `current` | a new reading: six counts; ADC; wheel and ADC |
| `echo` | the ultrasonic's line rises (true) or falls (false) |
| `start` | the program begins anew, with this reset cause; 0: restarted by itself. The clock goes on |
| `out` | bytes from the board: what it has sent at this time |
| `duty` | what is on the motors from now on; it was 0, 0 |
| `restart` | the board asks for its restart |

Time goes in steps of 100 us: the tick (at each whole millisecond since the start), a pass, then what comes in, and
a pass for that; then what comes out, the duty and the restart, as far as they changed. A pass reads one line.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.firmware import host, tools

FOLDER = tools.ROOT / "tests/vectors/firmware"
Step = tuple[float, dict[str, Any]]
"""Milliseconds since the start, and what comes in."""


def sealed(body: str, sequence: int) -> str:
    """A sealed line with its end."""
    return host.seal(f"{body} {sequence}") + "\r"


def line(at_ms: float, text: str) -> Step:
    """A line without a seal."""
    return at_ms, {"in": text + "\r"}


def checked(at_ms: float, body: str, sequence: int) -> Step:
    """A sealed line."""
    return at_ms, {"in": sealed(body, sequence)}


def _classic() -> Iterator[Step]:
    yield 5, {"edges": [7, -4]}
    yield 12, {"imu": [-16384, 0, 32767, 131, -32768, -1]}
    yield 13, {"battery": 3012}
    yield line(25, "s 120 -80")
    yield line(26, "s 300 -32768")
    for offset, text in enumerate(
        ("s 1", "s 1 2 3", "s  1 2", "S 1 2", "x", "s 40000 0", "r 1", "s 1 2*0000", "")
    ):
        yield line(30 + offset, text)
    yield 41, {"in": "\ns 5 \n6\r"}
    yield 45, {"in": "s 11 "}
    yield 46, {"in": "12\rs 13 14\r"}
    yield checked(47, "s 1 1", 9)
    yield line(60, "s 0 0")
    yield line(70, "s 30 40")
    yield line(1100, "r")
    yield line(1120, "s 50 60")
    yield 1170, {"start": 0}
    yield line(1180, "s 50 60")
    yield 1250, {"start": 2}
    yield 1300, {}


def _negotiation() -> Iterator[Step]:
    yield line(3, "s 60 61")
    yield checked(12, "hello 2 250", 5)
    yield checked(13, "hello 1 49", 6)
    yield line(14, "hello 1 250 7*0000")
    yield checked(15, "hello 1 250", 200)
    yield checked(33, "s 70 71", 201)
    yield line(34, "s 80 81")
    yield line(35, "s 80 81 202*0000")
    yield checked(47, "hello 1 100", 204)
    yield line(60, "r")
    yield checked(100, "about", 203)
    yield checked(105, "about 1", 204)
    yield checked(2000, "x", 205)
    yield line(3990, "s 3 4 205*ABCD")
    yield line(4050, "s 15 16")
    yield checked(4070, "hello 1 2000", 1)
    yield 4140, {}


def _deadman() -> Iterator[Step]:
    yield checked(7, "hello 1 50", 0)
    yield checked(8, "s 100 -101", 1)
    yield checked(57, "s 102 -103", 2)
    yield line(120, "s 0 0")
    yield checked(130, "s 104 -105", 3)
    yield checked(140, "g 6 0", 4)
    yield checked(170, "hello 1 50", 5)
    yield checked(200, "s 0 0", 6)
    yield line(230, "s 0 0")
    yield 260, {}


def _refusals() -> Iterator[Step]:
    yield checked(5, "hello 1 2000", 255)
    bodies = [
        "s 10 -10",
        "x 1",
        "s 1",
        "s 1 2 3 4 5 6",
        "s 40000 0",
        "s 1.0 2",
        "w 1 1",
        "w 50001 0",
        "g 8 1",
        "g 1 20001",
    ]
    bodies += ["arm 1", "arm x", "hello 1 2001", "hello 3 250", "r 1", "", "estop 1", "s  1 2"]
    for sequence, body in enumerate(bodies):
        yield checked(20 + 3 * sequence, body, sequence)
    yield line(80, host.seal("s 1 2 256"))
    yield line(81, host.seal("s"))
    yield line(82, host.seal("s 1 2"))
    yield checked(84, "s 12 13", 30)
    yield checked(88, "s 14 15", 29)
    yield 170, {}


def _estop() -> Iterator[Step]:
    yield checked(5, "hello 1 250", 0)
    yield checked(20, "s 90 91", 1)
    yield line(31, "estop")
    yield checked(40, "s 90 91", 2)
    yield checked(50, "arm 2", 3)
    yield line(60, "s 0 0")
    yield line(61, "estop")
    yield checked(70, "r", 4)
    yield 125, {"start": 0}
    yield line(130, "s 20 21")
    yield checked(135, "arm 1", 9)
    yield checked(140, "arm 2", 10)
    yield line(145, "s 20 21")
    yield checked(150, "hello 1 250", 11)
    yield checked(160, "estop", 12)
    yield 175, {"start": 1}
    yield line(180, "s 22 23")
    yield 200, {}


def _sensors() -> Iterator[Step]:
    yield checked(5, "hello 1 2000", 0)
    yield checked(6, "g 6 600", 1)
    yield checked(7, "s 200 201", 2)
    for number in range(40):
        at_ms = 10 + 9.7 * number
        yield at_ms, {"imu": [number, -number, 16384, 0, 1, -2]}
        yield at_ms + 1, {"battery": 3000 + number}
        yield at_ms + 2, {"current": [0, 100 + number]}
        yield at_ms + 3, {"current": [1, 599 if number < 20 else 601]}
        if number in (6, 11, 16):
            yield at_ms + 3.2, {"echo": True}
            yield at_ms + 3.2 + 2.9 * (1 + number / 10), {"echo": False}
    yield 410, {"echo": False}
    yield 411, {"echo": True}
    yield 480, {"echo": False}
    yield checked(760, "s 200 201", 3)
    yield checked(770, "arm 0", 4)
    yield checked(775, "s 30 31", 5)
    yield 800, {}


def _wheel_loop() -> Iterator[Step]:
    yield checked(5, "hello 1 250", 0)
    for parameter, value in enumerate((1000, 600, 4000, 900, 1500)):
        yield checked(10 + parameter, f"g {parameter} {value}", 1 + parameter)
    yield checked(20, "w 3000 -2000", 6)
    for edge in range(60):
        yield 21 + 2 * edge, {"edges": [1, 0]}
        if edge % 3 == 0:
            yield 21.5 + 2 * edge, {"edges": [0, -1]}
    yield checked(60, "g 5 20000", 7)
    yield checked(80, "w -3000 0", 8)
    yield checked(120, "g 7 300", 9)
    yield checked(140, "w 400 500", 10)
    yield checked(180, "s 9 8", 11)
    yield checked(200, "w 1000 1000", 12)
    yield line(220, "s 0 0")
    yield checked(230, "w 50000 -50000", 13)
    yield checked(440, "w 50000 -50000", 14)
    yield checked(500, "w 1000 1000", 15)
    yield line(510, "s 0 0")
    yield checked(515, "g 0 65535", 16)
    yield checked(520, "w 9588 0", 17)
    yield checked(525, "w 9587 0", 18)
    for edge in range(40):
        yield 527 + 5 * edge, {"edges": [1 - 2 * (edge % 2), 0]}
    yield checked(600, "w 9587 0", 19)
    yield checked(800, "w 9587 0", 20)
    yield checked(810, "arm 0", 21)
    yield checked(815, "w 2000 0", 22)
    yield 840, {}


def _wraps() -> Iterator[Step]:
    yield checked(5, "hello 1 100", 250)
    for number in range(10):
        yield checked(6 + 9 * number, f"s {number} {-number}", (251 + number) % 256)
    yield 101, {"edges": [-3, 3]}
    yield 250, {}


def _damaged() -> Iterator[Step]:
    yield line(5, "s 1 2")
    yield 10, {"in": "s 3 4" + " " * 60 + "\rs 5 6\r"}
    yield 15, {"in": "s 7\x00 8\r"}
    yield 16, {"in": "s 7 \x808\r"}
    yield 17, {"in": "s 7\t8\r"}
    yield 20, {"in": "s 9"}
    yield 21, {"lost": 2}
    yield 22, {"in": "9 9\r"}
    yield 23, {"in": "s 0 0\r"}
    yield checked(24, "hello 1 250", 0)
    yield 25, {"in": "x" * 100 + "\r"}
    yield 30, {"in": sealed("s 21 22", 1)}
    yield 31, {"in": "\r\r\r" + sealed("s 23 24", 2)}
    yield 40, {"in": "\n" + sealed("s 25 26", 3) + "\n"}
    yield 50, {"in": sealed("s 27 28", 4).replace("7", "7\n")}
    yield 60, {"in": "s 0\n 0\r"}
    yield 200, {}


CONVERSATIONS = {
    "classic": ("The classic wire: cycle, commands, what is refused, r and restarts", 0, True, _classic),
    "negotiation": (
        "hello in both modes, what is no hello, the return to the classic mode",
        0,
        True,
        _negotiation,
    ),
    "deadman": ("What feeds the dead-man, and what does not", 0, True, _deadman),
    "refusals": ("Each reason to refuse a sealed line", 0, True, _refusals),
    "estop": ("The e-stop, over restarts, and its arm", 0, True, _estop),
    "sensors": ("Readings and their ages, a stall", 0, True, _sensors),
    "wheel_loop": ("The wheel loop, with edges, ramp, battery and stops", 0, False, _wheel_loop),
    "wraps": ("Clock and sequence numbers wrap", (1 << 32) - 60_000, True, _wraps),
    "damaged": ("Overlong lines, bytes that are not printable, lost bytes", 0, True, _damaged),
}


def _apply(board: host.Board, step: dict[str, Any]) -> None:
    for key, value in step.items():
        match key:
            case "in":
                board.receive(value.encode("latin-1"))
            case "lost":
                for _ in range(value):
                    board.receive_lost()
            case "edges":
                for wheel, count in enumerate(value):
                    board.edges(wheel, count)
            case "imu" | "battery":
                board.measure(**{key: value})
            case "current":
                board.measure(current={value[0]: value[1]})
            case "echo":
                board.echo(value)
            case "start":
                board.start(value)
            case _:
                raise ValueError(f"a conversation knows no {key!r}")
    board.step()


class _Recorder:
    """What the board does, as rows, when it changes."""

    def __init__(self, board: host.Board) -> None:
        self._board, self._duty, self._restarts = board, (0, 0), 0

    def rows(self, at_us: int) -> Iterator[dict[str, Any]]:
        board = self._board
        if board.raw:
            yield {"at_us": at_us, "out": board.raw.decode()}
            board.forget()
        if board.duty != self._duty:
            self._duty = board.duty
            yield {"at_us": at_us, "duty": list(board.duty)}
        if board.fake.restarts > self._restarts:
            self._restarts = board.fake.restarts
            yield {"at_us": at_us, "restart": True}


def rows(name: str) -> Iterator[dict[str, Any]]:
    """The conversation of that name, held with the host build."""
    about, micros, has_imu, script = CONVERSATIONS[name]
    board = host.Board(micros=micros, has_imu=has_imu)
    recorder, now_us = _Recorder(board), 0
    yield {"about": about, "micros": micros, "imu": has_imu}
    yield from recorder.rows(0)
    for at_ms, step in script():
        while now_us < round(at_ms * 10) * 100:
            board.run_us(100)
            now_us += 100
            yield from recorder.rows(now_us)
        if step:
            yield {"at_us": now_us, **step}
            _apply(board, step)
            yield from recorder.rows(now_us)


def text(name: str) -> str:
    """The file of that conversation."""
    return "".join(json.dumps(row) + "\n" for row in rows(name))


def write(folder: Path) -> None:
    """Write all conversations into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in CONVERSATIONS:
        (folder / f"{name}.jsonl").write_text(text(name), encoding="utf-8")


if __name__ == "__main__":
    write(FOLDER)
