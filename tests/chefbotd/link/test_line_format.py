"""A board that writes its lines or its clock in another way is told so, and its cable is not blamed."""

import asyncio
import random
from collections.abc import Callable

import pytest

from chefbotd.clock import run_virtual
from chefbotd.link.line_format import TimeUnitWatch, describe_rate
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice

CYCLE_S = 0.05
Lines = Callable[[int], list[bytes]]


def good(number: int) -> list[bytes]:
    """A cycle of a board at rest."""
    return [
        f"t\t{50_000 * number}\t{CYCLE_S:.2f}".encode(),
        b"e\t0\t0",
        b"u\t120",
        b"s\t0.00\t0.00",
        b"b\t2804.00",
    ]


def with_lines(**changed: Callable[[int], bytes]) -> Lines:
    """Good cycles in which some kinds are written otherwise."""

    def cycle(number: int) -> list[bytes]:
        return [
            changed[line[:1].decode()](number) if line[:1].decode() in changed else line
            for line in good(number)
        ]

    return cycle


def link_after(cycle: Lines, seconds: float = 4.0) -> tuple[str, str]:
    """Condition and reason of the link after so long."""

    async def main() -> tuple[str, str]:
        device = FakeSerialDevice()
        board = ScriptedBoard(device)
        async with running_daemon(device) as robot:
            for number in range(1, int(seconds / CYCLE_S)):
                board.say(b"".join(line + b"\n" for line in cycle(number)))
                await asyncio.sleep(CYCLE_S)
            link = (await robot.get_state()).link
            return str(link.condition), link.reason

    return run_virtual(main())


def test_a_good_board_is_healthy() -> None:
    """The reference: nothing is wrong with it."""
    assert link_after(good) == ("healthy", "")


@pytest.mark.parametrize(
    ("kind", "line", "what"),
    [
        ("u", b"u\t57,3", "such as 'u\\t57,3'"),
        ("u", b"u\t-7", "expected a whole number from 0 to 32767, got -7"),
        ("e", b"e\t1\t2\t3\t4", "expected 2 numbers, got 4"),
        ("b", b"b\t70000.00", "got 70000.00"),
        ("b", b"b\t11.3V", "got '11.3V'"),
    ],
)
def test_a_kind_that_is_always_refused_is_a_format(kind: str, line: bytes, what: str) -> None:
    """The link's condition names the kind, and says what it has and what was expected."""
    condition, reason = link_after(with_lines(**{kind: lambda number: line}))
    assert condition == "lines_refused"
    assert f"every '{kind}' line is refused" in reason
    assert what in reason


def test_a_format_is_named_though_some_of_its_lines_are_damaged_besides() -> None:
    """One line in twelve is refused for another reason; the complaint comes, and stays."""
    line = {0: b"u\t57,3\t9"}
    condition, reason = link_after(with_lines(u=lambda number: line.get(number % 12, b"u\t57,3")), 10.0)
    assert condition == "lines_refused"
    assert "every 'u' line is refused" in reason


def test_a_reading_of_the_clock_that_waited_ends_no_complaint_about_its_unit() -> None:
    """It counts milliseconds; every second one of its readings at a span's end waited for a second."""
    watch, told = TimeUnitWatch(), list[str | None]()
    for number in range(2000):
        late_s = 1.0 if number % 200 == 0 else 0.0
        watch.observe(int(1e3 * CYCLE_S * number), CYCLE_S * number + late_s)
        told.append(watch.complaint)
    first = next(k for k, complaint in enumerate(told) if complaint)
    assert first < 300
    assert None not in told[first:]


def test_lines_with_another_separator_are_a_format() -> None:
    """All of them are text to the protocol: the answer is not that another device is plugged in."""
    condition, reason = link_after(lambda number: [line.replace(b"\t", b" ") for line in good(number)])
    assert condition == "lines_refused"
    assert "TAB" in reason


def test_damaged_lines_are_no_format() -> None:
    """Every second byte of the ultrasonic's line is noise in three lines of four: that is a cable."""
    noise = random.Random(1)

    def damaged(number: int) -> bytes:
        line = bytearray(b"u\t120")
        if number % 4:
            line[noise.randrange(2, 5)] = noise.randrange(0x80, 0x100)
        return bytes(line)

    condition, _ = link_after(with_lines(u=damaged), 10.0)
    assert condition == "healthy"


@pytest.mark.parametrize(
    ("per_s", "unit"),
    [(1e3, "milliseconds"), (1.0, "seconds"), (5e5, "0.5 times as fast"), (2e6, "2 times as fast")],
)
def test_a_clock_in_another_unit_is_named(per_s: float, unit: str) -> None:
    """The board counts so many a second, and says how long its cycles take as it should."""
    lines = with_lines(t=lambda number: f"t\t{int(CYCLE_S * number * per_s)}\t{CYCLE_S:.2f}".encode())
    condition, reason = link_after(lines, 6.0)
    assert condition == "wrong_time_unit"
    assert unit in reason


@pytest.mark.parametrize("rate", [0.99, 1.0, 1.01])
def test_a_poor_resonator_is_a_clock(rate: float) -> None:
    """What a part may be off is followed, and nothing is said."""
    assert describe_rate(rate) is None


def test_a_restarting_board_is_no_wrong_clock() -> None:
    """Its clock begins anew every two seconds: no two spans agree on another unit."""
    watch, told = TimeUnitWatch(), set[str | None]()
    for number in range(400):
        watch.observe(50_000 * (number % 40), CYCLE_S * number)
        told.add(watch.complaint)
    assert told == {None}


def test_a_clock_that_wraps_is_a_clock() -> None:
    """After 71.6 minutes the number begins at 0 again."""
    watch, told = TimeUnitWatch(), set[str | None]()
    for number in range(400):
        watch.observe((2**32 - 3_000_000 + 50_000 * number) % 2**32, CYCLE_S * number)
        told.add(watch.complaint)
    assert told == {None}
