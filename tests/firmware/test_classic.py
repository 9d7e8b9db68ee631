"""Without negotiation the board speaks the classic wire, and any host of that can drive it."""

import json

import pytest

from firmware_protocol.codec import CLASSIC, from_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import (
    Banner,
    BatteryLevel,
    BoardTime,
    DutyEcho,
    EncoderCounts,
    RawImu,
    Text,
    UltrasonicDistance,
)
from tests.firmware import host, tools

TO_BOARD = json.loads((tools.ROOT / "tests/vectors/to_board.json").read_text(encoding="utf-8"))
FROM_BOARD = json.loads((tools.ROOT / "tests/vectors/from_board.json").read_text(encoding="utf-8"))


def test_it_starts_with_the_banner_and_its_name(board: host.Board) -> None:
    """The banner is the classic sketch's; the name tells proto, version, board, capabilities and the cause."""
    assert board.raw == (
        b"Initializing I2C devices...\r\nTesting device connections...\r\nMPU6050 connection successful\r\n"
        b"firmware\t1\t0\t1\t4\t31\t1\n"
    )


def test_a_silent_imu_is_in_the_banner() -> None:
    """The last line of the banner says that the IMU does not answer."""
    tools.need("gcc", "make")
    assert "MPU6050 connection failed" in host.Board(has_imu=False).sent


def test_a_cycle_has_the_classic_lines_in_their_order(board: host.Board) -> None:
    """`t e u s i b`, letter for letter, with the classic ends of lines."""
    board.edges(0, 5)
    board.edges(1, -3)
    board.measure(imu=(-16384, 0, 32767, 131, -32768, -1), battery=3012)
    board.write("s 120 -80")
    board.forget()
    board.run(0.02)
    assert board.raw == (
        b"t\t20000\t0.02\ne\t5\t-3\nu\t0\ns\t120.00\t-80.00\ni\t-16384\t0\t32767\t131\t-32768\t-1\r\n\nb\t3012.00\n"
    )


def test_the_line_of_the_imu_is_left_out_without_a_reading(board: host.Board) -> None:
    """`i` is not made up; it stays as it was once there has been one."""
    board.forget()
    board.run(0.02)
    assert [line[0] for line in board.sent] == list("teusb")
    board.measure(imu=(1, 2, 3, 4, 5, 6))
    board.run(0.02)
    board.forget()
    board.run(0.02)
    assert [line[0] for line in board.sent] == list("teusib")


def test_a_cycle_takes_20_ms(board: host.Board) -> None:
    """50 cycles a second, each at its time."""
    board.run(1.0)
    times = [line.split("\t")[1] for line in board.sent if line[0] == "t"]
    assert times == [str(20_000 * number) for number in range(1, 51)]


def test_it_says_its_name_once_a_second(board: host.Board) -> None:
    """A host need not write anything to find out: after the 50th cycle, the 100th and so on."""
    board.forget()
    board.run(3.0)
    names = [index for index, line in enumerate(board.sent) if line.startswith("firmware")]
    assert names == [250, 501, 752]  # 50 cycles of 5 lines each, and the names before


def test_the_daemon_of_the_classic_wire_understands_all_of_it(board: host.Board) -> None:
    """The classic decoder refuses no line; the name is text to it."""
    board.measure(imu=(1, 2, 3, 4, 5, 6), battery=7)
    board.run(1.0)
    decoder = Decoder(from_board(CLASSIC))
    events = [message for _, message in decoder.feed(board.raw)]
    assert not decoder.malformed
    assert decoder.accepted == {
        "Banner": 3,
        "Text": 2,
        **dict.fromkeys(("BoardTime", "EncoderCounts", "UltrasonicDistance", "DutyEcho", "RawImu"), 50),
        "BatteryLevel": 50,
    }
    assert events[0] == Banner("Initializing I2C devices...")
    assert events[3] == Text("firmware\t1\t0\t1\t4\t31\t1")
    assert events[4:10] == [
        BoardTime(20_000, 0.02),
        EncoderCounts((0, 0)),
        UltrasonicDistance(0),
        DutyEcho((0.0, 0.0)),
        RawImu((1, 2, 3), (4, 5, 6)),
        BatteryLevel(7.0),
    ]


@pytest.mark.parametrize(
    "row", [row for row in TO_BOARD if row.get("means") == "SetDuty"], ids=lambda row: str(row["line"])
)
def test_golden_duties_are_obeyed(board: host.Board, row: dict[str, object]) -> None:
    """Each golden duty line takes effect, limited to what a motor takes."""
    board.write("s 1 1")
    board.write(str(row["line"]))
    asked = row["fields"]["duty"]  # type: ignore[index]
    assert board.duty == tuple(max(-255, min(255, duty)) for duty in asked)


@pytest.mark.parametrize(
    "row", [row for row in TO_BOARD if "refused" in row], ids=lambda row: repr(row["line"])
)
def test_golden_refusals_are_refused(board: host.Board, row: dict[str, str]) -> None:
    """Each line that the codec refuses, the board refuses too: the duty stays."""
    board.write("s 20 -30")
    board.write(row["line"])
    board.run(0.1)
    assert (board.duty, board.fake.restarts) == ((20, -30), 0)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"battery": 3012}, "b\t3012.00"),
        ({"imu": (-16384, 0, 32767, 131, -32768, -1)}, "i\t-16384\t0\t32767\t131\t-32768\t-1"),
    ],
)
def test_golden_lines_are_written_alike(board: host.Board, values: dict[str, object], line: str) -> None:
    """Numbers have the form of the codec's golden lines."""
    assert line in [row["line"] for row in FROM_BOARD]
    board.measure(**values)  # type: ignore[arg-type]
    board.run(0.02)
    assert line in board.sent


def test_the_clock_is_written_up_to_its_last_microsecond() -> None:
    """The golden `t` of the clock's last value: 20 ms after 4294947295."""
    tools.need("gcc", "make")
    board = host.Board(micros=4_294_947_295)
    board.run(0.02)
    assert "t\t4294967295\t0.02" in board.sent


def test_r_stops_answers_and_restarts(board: host.Board) -> None:
    """`r`: motors off at once, `Reset Done`, and the restart 50 ms later, which names its cause."""
    board.write("s 50 60")
    board.forget()
    board.write("r")
    assert (board.duty, board.raw) == ((0, 0), b"Reset Done\r\n")
    board.write("s 70 80")
    board.run(0.049)
    assert (board.duty, board.fake.restarts) == ((0, 0), 0)
    board.run(0.002)
    assert board.fake.restarts == 1
    board.start(host.SOFTWARE)
    assert board.sent[-1] == "firmware\t1\t0\t1\t4\t31\t5"


def test_a_duty_stays_without_repetition(board: host.Board) -> None:
    """Hosts of the classic wire do not repeat their commands: there is no dead-man."""
    board.write("s 100 100")
    board.run(5.0)
    assert board.duty == (100, 100)


@pytest.mark.parametrize("body", ["s 10 10", "w 1 1", "g 0 1000", "x"])
def test_what_belongs_to_the_checked_mode_is_an_unknown_word(board: host.Board, body: str) -> None:
    """A sealed line tells a host that the board is not in the mode that it believes: refused 1."""
    board.forget()
    board.seal(body, 9)
    assert (board.duty, board.bodies()) == ((0, 0), [["refused", "1", "9"]])
