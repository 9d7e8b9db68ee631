"""The checked mode: what is negotiated, what is obeyed, what is refused and with which answer."""

import pytest

from tests.firmware import host


@pytest.fixture
def checked(board: host.Board) -> host.Board:
    """A board in the checked mode with a dead-man of 250 ms; sequence number 1 is next."""
    board.hello()
    return board


def counters(board: host.Board) -> list[int]:
    """CRC, refused, overrun, gaps, dead-man, late: the newest line of them."""
    return [int(field) for field in board.bodies("counters")[-1][1:]]


def test_the_crc_is_the_published_one() -> None:
    """CRC-16/IBM-3740 of 123456789 is 0x29B1, so the oracle of these tests is the wire's."""
    assert host.crc(b"123456789") == 0x29B1


def test_hello_begins_the_checked_mode(board: host.Board) -> None:
    """The answer has the dead-man, the clock at the hello's CR and its sequence number, and is sealed with number 0."""
    board.run(0.012)
    board.forget()
    board.receive(host.seal("hello 1 300 77").encode() + b"\r")
    board.fake.micros += 345  # the main loop comes to it later
    board.step()
    assert board.sent == [host.seal("hello\t1\t300\t12000\t77\t0")]


def test_the_first_cycle_comes_10_ms_after_hello(board: host.Board) -> None:
    """Then one each 10 ms: `t e s`, all sealed, with one sequence number after the other."""
    board.run(0.012)
    board.hello()
    board.run(0.031)
    assert [body[:2] for body in board.bodies("t")] == [["t", "22000"], ["t", "32000"], ["t", "42000"]]
    numbers = [int(host.unsealed(line).split("\t")[-1]) for line in board.sent]
    assert numbers == list(range(1, 1 + len(numbers)))


def test_sequence_numbers_wrap_at_256(checked: host.Board) -> None:
    """0 follows 255."""
    checked.run(1.0)
    numbers = [int(host.unsealed(line).split("\t")[-1]) for line in checked.sent]
    assert numbers[253:258] == [254, 255, 0, 1, 2]


def test_the_cycle_tells_counts_duty_and_the_obeyed_line(checked: host.Board) -> None:
    """Three decimals for the seconds, whole duties, and the sequence number of the last obeyed `s`."""
    checked.edges(0, -7)
    checked.edges(1, 9)
    checked.run(0.01)
    assert checked.bodies()[:3] == [["t", "10000", "0.010"], ["e", "-7", "9"], ["s", "0", "0", "255"]]
    number = checked.seal("s 120 -300", 42)
    checked.forget()
    checked.run(0.01)
    assert checked.duty == (120, -255)
    assert checked.bodies()[2] == ["s", "120", "-255", str(number)]


def test_the_duty_in_force_is_kept_when_the_mode_begins(board: host.Board) -> None:
    """A hello in the middle of a motion does not stop it."""
    board.write("s 90 91")
    board.hello()
    assert board.duty == (90, 91)


@pytest.mark.parametrize(
    "body", ["hello 2 250", "hello 0 250", "hello 1 49", "hello 1 2001", "hello 1 0", "hello 1 -250"]
)
@pytest.mark.parametrize("is_checked", [False, True])
def test_a_hello_with_another_proto_or_dead_man_changes_nothing(
    board: host.Board, body: str, is_checked: bool
) -> None:
    """Refused with 7 or 3; the mode and its dead-man stay."""
    if is_checked:
        board.hello(100)
    board.forget()
    board.seal(body, 200)
    assert board.bodies() == [["refused", "3" if body.startswith("hello 1") else "7", "200"]]
    board.seal("s 5 5", 201)
    board.run(0.099)
    assert board.duty == ((5, 5) if is_checked else (0, 0))
    board.run(0.002)
    assert board.duty == (0, 0)


@pytest.mark.parametrize(("deadman_ms", "answer"), [(50, "50"), (2000, "2000")])
def test_the_ends_of_the_dead_mans_range_are_accepted(
    board: host.Board, deadman_ms: int, answer: str
) -> None:
    """50 and 2000 ms."""
    board.forget()
    board.seal(f"hello 1 {deadman_ms}")
    assert board.bodies() == [["hello", "1", answer, "0", "0"]]


@pytest.mark.parametrize(
    ("body", "what"),
    [
        ("x 1", 1),
        ("S 1 1", 1),
        ("", 1),
        ("hell 1 250", 1),
        ("helloo 1 250", 1),
        ("s 1", 2),
        ("s 1 2 3", 2),
        ("s  1 2", 2),
        ("w 1", 2),
        ("g 1", 2),
        ("arm", 2),
        ("r 1", 2),
        ("hello 1", 2),
        ("s 1 2 3 4 5 6 7", 2),
        ("s 32768 0", 3),
        ("s 0 -32769", 3),
        ("s 1.0 2", 3),
        ("s +1 2", 3),
        ("s 1 -", 3),
        ("s 1 99999999999", 3),
        ("w 50001 0", 3),
        ("w 0 -50001", 3),
        ("g 8 1", 3),
        ("g -1 1", 3),
        ("g 0 63", 3),
        ("g 0 65536", 3),
        ("g 1 20001", 3),
        ("g 2 500001", 3),
        ("g 3 20001", 3),
        ("g 4 65281", 3),
        ("g 5 1000001", 3),
        ("g 6 4096", 3),
        ("g 7 63", 3),
        ("g 7 1025", 3),
        ("g 1 -1", 3),
        ("w 1 1", 5),
        ("arm 1", 6),
        ("arm -1", 6),
        ("arm x", 6),
        ("hello 7 250", 7),
    ],
)
def test_a_sealed_line_that_cannot_be_obeyed_is_answered(checked: host.Board, body: str, what: int) -> None:
    """The reason, and the line's sequence number; the duty stays."""
    checked.seal("s 10 -10")
    checked.forget()
    number = checked.seal(body)
    assert checked.bodies("refused") == [["refused", str(what), str(number)]]
    assert checked.duty == (10, -10)


@pytest.mark.parametrize(
    ("line", "what"), [("s 1 2 256", 3), ("s 1 2 -1", 3), ("s 1 2 x", 3), ("s 1 2 ", 3), ("s", 2), ("zz", 1)]
)
def test_a_line_without_a_sequence_number_is_answered_with_255(
    checked: host.Board, line: str, what: int
) -> None:
    """There is no number to name."""
    checked.write(host.seal(line))
    assert checked.bodies("refused") == [["refused", str(what), "255"]]
    assert checked.duty == (0, 0)


@pytest.mark.parametrize(
    "line",
    [
        "s 10 20",
        "r",
        "s 10 20 5*0000",
        "s 10 20 5",
        "s 0 0 5*0000",
        "s 0 00",
        "s -0 0",
        "S 0 0",
        " s 0 0",
        "s 0 0 ",
        "estop 1",
        "arm 0",
        "hello 1 250 5",
        host.seal("s 10 20 0").lower(),
        host.seal("s 10 20 5") + " ",
        "*",
        "*0000",
        "",
    ],
)
def test_without_a_valid_crc_nothing_changes(checked: host.Board, line: str) -> None:
    """No motion, no reset, no stop but by the words for it, and no answer."""
    checked.seal("s 30 -30")
    checked.forget()
    checked.write(line)
    assert (checked.duty, checked.raw) == ((30, -30), b"")
    checked.run(0.1)
    assert (checked.duty, checked.fake.restarts) == ((30, -30), 0)


@pytest.mark.parametrize("is_checked", [False, True])
def test_a_stop_needs_no_crc(board: host.Board, is_checked: bool) -> None:
    """`s 0 0`, in each mode."""
    if is_checked:
        board.hello()
        board.seal("s 30 -30")
    else:
        board.write("s 30 -30")
    assert board.duty == (30, -30)
    board.write("s 0 0")
    assert board.duty == (0, 0)


def test_a_stop_without_a_number_keeps_the_last_obeyed_one(checked: host.Board) -> None:
    """The echo's number stays that of the last `s` with one."""
    number = checked.seal("s 30 -30")
    checked.write("s 0 0")
    checked.forget()
    checked.run(0.01)
    assert checked.bodies("s") == [["s", "0", "0", str(number)]]


def test_counters_tell_what_was_refused(checked: host.Board) -> None:
    """A wrong CRC, lines without any and refused ones, lost bytes, numbers left out, dead-man stops."""
    checked.write("s 1 1 1*0000")  # CRC
    checked.write("s 1 1 1*G000")  # CRC
    checked.write("s 1 1")  # refused: no seal
    checked.write("r")  # refused
    checked.seal("x")  # refused, number 1
    checked.receive_lost()  # overrun
    checked.write("s 0 0")  # refused: the lost byte may have been of this line
    checked.seal("s 1 1", 5)  # 2, 3 and 4 are left out
    checked.seal("s 1 1", 2)  # and 6 to 255, 0, 1
    checked.run(0.251)  # dead-man
    assert counters(checked) == [2, 4, 1, 3 + 252, 0, 0]
    checked.run(1.0)
    assert counters(checked) == [2, 4, 1, 3 + 252, 1, 0]


def test_no_number_is_missing_over_256_lines(checked: host.Board) -> None:
    """The numbers wrap, and nothing counts as left out."""
    for _ in range(300):
        checked.seal("s 1 1")
    checked.run(0.151)
    assert counters(checked)[3] == 0


def test_after_two_silent_seconds_the_classic_wire_is_back(checked: host.Board) -> None:
    """2 s after the last valid line, whose first cycle comes 20 ms later; motors off."""
    checked.run(0.5)
    checked.seal("s 1 1")
    checked.run(1.999)
    assert all("*" in line for line in checked.sent)
    checked.forget()
    checked.write("s 1 1 5*0000")  # not valid: does not count
    checked.run(0.0205)
    checked.forget()
    checked.run(0.001)
    assert [line[0] for line in checked.sent] == list("teusb")
    assert checked.sent[0] == "t\t2520000\t0.03"
    checked.write("s 15 16")
    assert checked.duty == (15, 16)


def test_a_valid_line_of_any_kind_keeps_the_mode(checked: host.Board) -> None:
    """Also one that is refused."""
    for _ in range(4):
        checked.run(1.9)
        checked.seal("x")
    assert all("*" in line for line in checked.sent)


def test_a_repeated_hello_is_answered_and_moves_no_cycle(checked: host.Board) -> None:
    """It measures the round trip as often as a host wants."""
    checked.run(0.004)
    number = checked.seal("hello 1 250")
    checked.run(0.011)
    assert checked.bodies("hello") == [["hello", "1", "250", "4000", str(number)]]
    assert [body[1] for body in checked.bodies("t")] == ["10000"]


def test_a_sealed_reset_restarts_in_both_modes(checked: host.Board) -> None:
    """Motors off, `Reset Done`, restart."""
    checked.seal("s 50 50")
    checked.forget()
    checked.seal("r")
    assert (checked.duty, checked.raw) == ((0, 0), b"Reset Done\r\n")
    checked.run(0.051)
    assert checked.fake.restarts == 1


def test_every_line_kind_comes_as_often_as_it_may(checked: host.Board) -> None:
    """In a second: 100 `t e s`, 20 `u`, 25 `i`, 5 `b`, 10 `a` of each wheel, 5 `state` and its first, 1 `counters`."""
    for _ in range(100):
        checked.measure(imu=range(6), battery=2000, current={0: 5, 1: 6})
        checked.seal("s 0 0")
        checked.run(0.01)
    kinds = [body[0] for body in checked.bodies()]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        **dict.fromkeys("tes", 100),
        "u": 18,  # of those that did not come: the first is missed at 100 ms
        "i": 25,
        "b": 5,
        "a": 20,
        "state": 6,
        "counters": 1,
    }
