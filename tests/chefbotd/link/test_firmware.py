"""A session with a board that runs our firmware: the negotiation, and what is written in each mode."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from itertools import pairwise
from pathlib import Path

import pytest

from chefbotd.bus import Inbox
from chefbotd.clock import LoopClock
from chefbotd.core import events
from chefbotd.link.board_memory import BoardFile, BoardMemory
from chefbotd.link.counting import Counting
from chefbotd.link.port import LinkParameters
from chefbotd.link.session import BoardSession
from firmware_protocol.checked import seal, unseal
from firmware_protocol.codec import CLASSIC
from tests.chefbotd.link.bench import OPENING, STOP, Bench, cycle, on_bench

NAMED = b"firmware\t1\t0\t1\t2\t11\t4\n"
"""Our firmware 0.1 on a TM4C123, with wheel loop, ultrasonic and battery, restarted by its watchdog."""


class OwnBoard:
    """The board's end of a bench's device, with our firmware as the test plays it."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.sequence, self.micros = bench, 0, 0
        self.reports = bench.bus.subscribe(events.FirmwareReported)

    def say(self, *bodies: str) -> None:
        """Checked lines, with their numbers."""
        lines = []
        for body in bodies:
            lines.append(seal(body.encode(), self.sequence, b"\t") + b"\n")
            self.sequence = (self.sequence + 1) % 256
        self.bench.device.feed(b"".join(lines))

    def cycle(self, left: int = 0, right: int = 0, of: int = 255) -> None:
        """The `t e s` of a checked cycle."""
        self.micros += 10_000
        self.say(f"t\t{self.micros}\t0.010", "e\t0\t0", f"s\t{left}\t{right}\t{of}")

    async def cycles(self, count: int, *duty: int) -> None:
        """So many cycles, 10 ms apart."""
        for _ in range(count):
            await asyncio.sleep(0.01)
            self.cycle(*duty)

    def written(self) -> list[bytes]:
        """What was written since the last call, line by line."""
        lines = bytes(self.bench.device.written).split(b"\r")[:-1]
        self.bench.device.written.clear()
        return lines

    def bodies(self) -> list[bytes]:
        """The same without seals, which have to be right."""
        return [(unseal(line, b" ") or (line, 0))[0] for line in self.written()]

    async def agree(self) -> None:
        """It names itself, is greeted, and answers; the checked mode has begun."""
        await asyncio.sleep(0.1)
        self.bench.device.feed(NAMED)
        hello = self.written()[-1]
        unsealed = unseal(hello, b" ")
        assert unsealed is not None, hello
        await asyncio.sleep(0.004)
        self.say(f"hello\t1\t250\t{self.micros}\t{unsealed[1]}")

    def report(self) -> events.FirmwareReported:
        """The newest report."""
        *_, newest = [self.reports.take_event() for _ in range(len(self.reports))]
        return newest


def on_own_board(
    scenario: Callable[[Bench, OwnBoard], Awaitable[None]], memory: BoardMemory | None = None
) -> None:
    """Run a scenario with a board of our firmware."""

    async def run(bench: Bench) -> None:
        await scenario(bench, OwnBoard(bench))

    on_bench(run, memory=memory)


def test_a_classic_sketch_is_written_nothing_but_what_it_is_told():
    """In ten seconds of its cycles nothing goes out beside the two stops of the opening and the one command."""

    async def scenario(bench: Bench) -> None:
        for number in range(500):
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number))
            if number == 100:
                bench.session.send_duty((120, -80))
            bench.session.repeat_duty((120, -80))
        assert bytes(bench.device.written) == OPENING + b"s 120 -80\r"

    on_bench(scenario)


def test_a_board_that_names_itself_is_greeted_and_the_mode_is_agreed_on():
    """The hello asks for 250 ms; the answer, 4 ms later, begins the checked mode, with that round trip."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        report = board.report()
        assert (report.mode, report.version, report.board) == ("checked", "0.1", "tm4c123")
        assert (report.deadman_ms, report.reset_cause) == (250, "watchdog")
        assert report.capabilities == ("wheel_loop", "ultrasonic", "battery")
        assert report.round_trip_s == pytest.approx(0.004)

    on_own_board(scenario)


def test_commands_are_sealed_and_numbered_and_a_stop_is_not():
    """After the hello, number 0, come 1 and 2; the stop that ends the motion carries no CRC."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        board.cycle()
        board.written()
        for duty in ((50, -40), (60, -50), (0, 0)):
            bench.session.send_duty(duty)
            await board.cycles(2)
        lines = board.written()
        assert lines[:2] == [seal(b"s 50 -40", 1, b" "), seal(b"s 60 -50", 2, b" ")]
        assert lines[2] == b"s 0 0"

    on_own_board(scenario)


def test_readings_go_on_while_the_mode_is_negotiated():
    """A reading before the name, one between hello and answer, and one after it: each is published."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        bench.device.feed(cycle(0) + NAMED)
        bench.device.feed(cycle(1))
        await asyncio.sleep(0.02)
        bench.device.feed(cycle(2))
        board.say("hello\t1\t250\t5050000\t0", "u\t93\t2000")
        distances = [
            event.distance_cm for event in bench.heard() if isinstance(event, events.UltrasonicEchoed)
        ]
        assert distances == [87, 87, 87, 93]

    on_own_board(scenario)


def test_a_reading_of_the_checked_mode_is_stamped_by_its_age():
    """An echo that was taken 30 ms before its cycle is stamped 30 ms before it."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        await board.cycles(3)
        bench.heard()
        board.say("u\t93\t30000", "i\t1\t2\t3\t4\t5\t6\t10000")
        echo, inertial = bench.heard()
        assert isinstance(echo, events.UltrasonicEchoed)
        assert isinstance(inertial, events.InertialCounted)
        assert inertial.stamp_s - echo.stamp_s == pytest.approx(0.02)
        assert echo.arrival_s - echo.stamp_s == pytest.approx(0.03, abs=1e-6)

    on_own_board(scenario)


def test_from_its_name_on_a_board_is_driven_by_checked_lines_alone():
    """A duty before it has answered is a stop, and the ceiling is 0; the next one is sealed."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        bench.session.send_duty((30, 31))
        assert board.written()[-1] == b"s 30 31"
        bench.device.feed(NAMED)
        bench.session.send_duty((40, 41))
        assert bench.session.duty_ceiling(0.0) == (0, 0)
        assert board.bodies() == [b"hello 1 250", b"s 0 0"]
        await asyncio.sleep(0.004)
        board.say("hello\t1\t250\t0\t0")
        board.cycle()
        bench.session.send_duty((50, 51))
        await board.cycles(2)
        assert b"s 50 51" in board.bodies()
        assert bench.session.duty_ceiling(0.0) is None

    on_own_board(scenario)


def test_a_board_that_answers_no_hello_stands_and_the_cable_is_named_with_figures():
    """Three hellos 0.3 s apart, and three more each second; no motion, and the link says how many lines were damaged."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        health = bench.bus.subscribe(events.LinkHealthChanged)
        await asyncio.sleep(0.5)
        for number in range(200):
            if number % 50 == 10:
                bench.device.feed(NAMED)
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number) + (b"e\t1\t2x\n" if number % 2 else b""))
            if number > 10:
                bench.session.send_duty((70, 71))
            bench.session.judge_health()
        bodies = board.bodies()
        hellos = [body for body in bodies if body.startswith(b"hello")]
        assert 6 <= len(hellos) <= 8
        assert set(bodies) - set(hellos) == {b"s 0 0"}
        report = board.report()
        assert (report.mode, report.deadman_ms) == ("classic", None)
        figures = re.search(
            r"the cable is bad.* Of its (\d+) lines .* (\d+) came damaged \((\d+) %\)", report.reason
        )
        assert figures is not None, report.reason
        lines, damaged, percent = map(int, figures.groups())
        assert 0.05 < damaged / lines < 0.15
        assert percent == round(100 * damaged / lines)
        *_, told = [health.take_event() for _ in range(len(health))]
        assert (told.condition, told.healthy) == ("not_negotiated", False)

    on_own_board(scenario)


def test_an_answer_that_was_lost_is_asked_for_again():
    """The board's first checked line says that its answer was lost; the next hello agrees on the mode."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await asyncio.sleep(0.1)
        bench.device.feed(NAMED)
        board.written()
        board.sequence = 1
        board.cycle()
        bench.session.send_duty((50, -40))
        assert unseal(board.written()[-1], b" ") is not None
        await board.cycles(32)
        (hello,) = [line for line in board.written() if line.startswith(b"hello")]
        unsealed = unseal(hello, b" ")
        assert unsealed is not None
        board.say(f"hello\t1\t250\t{board.micros}\t{unsealed[1]}")
        assert board.report().deadman_ms == 250

    on_own_board(scenario)


def test_a_board_that_went_back_to_classic_is_asked_again():
    """After 2 s without us it prints classic cycles: from the third line on they count, and it is greeted at once."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        await board.cycles(3)
        await asyncio.sleep(2.5)
        board.written()
        bench.heard()
        for number in range(3):
            bench.device.feed(b"t\t%d\t0.02\ne\t1\t2\nu\t88\n" % (2_700_000 + number * 20_000))
            await asyncio.sleep(0.02)
        heard = bench.heard()
        assert [event.distance_cm for event in heard if isinstance(event, events.UltrasonicEchoed)] == [
            88
        ] * 3
        assert b"hello 1 250" in board.bodies()
        bench.session.send_duty((70, 71))
        assert board.written()[-1] == b"s 0 0"

    on_own_board(scenario)


@pytest.mark.parametrize("is_older", [False, True])
def test_a_board_is_asked_once_what_it_counts_and_which_build_it_is(is_older: bool):
    """With the second hello; its answer is told. A firmware of before refuses the word (1), and is not asked again."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        asked = 0
        for _ in range(300):
            await asyncio.sleep(0.01)
            board.cycle()
            for line in board.written():
                body, number = unseal(line, b" ") or (line, 0)
                if body.startswith(b"hello"):
                    board.say(f"hello\t1\t250\t{board.micros}\t{number}")
                if body == b"about":
                    asked += 1
                    board.say(f"refused\t1\t{number}" if is_older else "about\t4\t12500\t41394\t0")
        report = board.report()
        assert asked == 1
        told = (report.build, report.counted_edges, report.most_edges_s)
        assert told == (("", None, None) if is_older else ("A1B2", 4, 12_500))

    on_own_board(scenario)


def test_another_board_in_the_place_of_ours_is_driven_as_what_it_is():
    """After four seconds of whole classic lines without a name it is a sketch; on a damaged line it is still ours."""

    async def scenario(bench: Bench, board: OwnBoard, damage: bytes) -> list[bytes]:
        await board.agree()
        await board.cycles(3)
        bench.device.unplug()
        await asyncio.sleep(0.2)
        bench.device.plug()
        await bench.device.open(LinkParameters(), bench.session)
        for number in range(250):
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number) + (damage if number % 5 == 0 else b""))
            bench.session.send_duty((70 + number % 2, 71))
            bench.session.judge_health()
            if number == 190:
                assert set(board.written()) == {b"s 0 0"}
        return board.written()

    async def run(bench: Bench) -> None:
        assert b"s 70 71" in await scenario(bench, OwnBoard(bench), b"")
        assert set(await scenario(bench, OwnBoard(bench), b"e\t1\t2x\n")) == {b"s 0 0"}

    on_bench(run)


class StoredAtOnce(BoardFile):
    """The file, written by who asks for it."""

    def keep(self, *, is_ours: bool) -> None:
        """Not in a thread."""
        self.store(is_ours)


@pytest.mark.parametrize("damage", [b"", b"e\t1\t2x\n"])
def test_the_next_daemon_drives_a_board_of_ours_by_checked_lines_alone(tmp_path: Path, damage: bytes):
    """It named itself to a daemon before: another one moves nothing until it is asked, however late its name comes."""

    async def first(bench: Bench, board: OwnBoard) -> None:
        await board.agree()

    async def second(bench: Bench, board: OwnBoard) -> None:
        for number in range(150):
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number) + (damage if number % 5 == 0 else b""))
            bench.session.send_duty((70 + number % 2, 71))
            bench.session.judge_health()
        assert bench.session.duty_ceiling(0.0) == (0, 0)
        assert set(board.written()) == {b"s 0 0"}
        await board.agree()
        board.cycle()
        bench.session.send_duty((50, 51))
        await board.cycles(2)
        assert b"s 50 51" in board.bodies()

    on_own_board(first, StoredAtOnce(tmp_path / "boards", "/dev/fake"))
    on_own_board(second, StoredAtOnce(tmp_path / "boards", "/dev/fake"))


def test_the_next_daemon_says_why_a_board_that_does_not_name_itself_stands(tmp_path: Path):
    """Damaged lines, and the name never comes: after 4 s the link says what the board was, with figures."""
    memory = StoredAtOnce(tmp_path, "/dev/fake")
    memory.keep(is_ours=True)

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        health = bench.bus.subscribe(events.LinkHealthChanged)
        for number in range(230):
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number) + (b"e\t1\t2x\n" if number % 2 else b""))
            bench.session.judge_health()
        *_, told = [health.take_event() for _ in range(len(health))]
        assert told.condition == "not_negotiated"
        assert "ran our firmware when it was last heard" in told.reason
        assert "check the cable" in told.reason

    on_own_board(scenario, memory)


def test_a_sketch_where_a_board_of_ours_was_is_driven_and_remembered_as_one(tmp_path: Path):
    """Four seconds of whole lines without a name; the daemon after that one drives it from its first line on."""

    async def scenario(bench: Bench, board: OwnBoard, seconds: float) -> list[bytes]:
        for number in range(round(seconds / 0.02)):
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number))
            bench.session.send_duty((70 + number % 2, 71))
            bench.session.judge_health()
        return board.written()

    async def first(bench: Bench, board: OwnBoard) -> None:
        assert set(await scenario(bench, board, 3.9)) == {b"s 0 0"}
        assert b"s 70 71" in await scenario(bench, board, 0.5)

    async def second(bench: Bench, board: OwnBoard) -> None:
        assert b"s 70 71" in await scenario(bench, board, 0.1)

    memory = StoredAtOnce(tmp_path, "/dev/fake")
    memory.keep(is_ours=True)
    on_own_board(first, memory)
    on_own_board(second, memory)


def test_a_board_that_restarted_is_classic_and_asked_again():
    """Its banner ends the checked mode: `BoardRestarted`, and a hello as soon as it has named itself again."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        await board.cycles(50)
        board.written()
        await asyncio.sleep(0.3)
        bench.device.feed(b"Initializing I2C devices...\r\nTesting device connections...\r\n" + NAMED)
        assert any(isinstance(event, events.BoardRestarted) for event in bench.heard())
        assert board.bodies() == [b"hello 1 250"]

    on_own_board(scenario)


def test_a_cable_that_was_pulled_and_plugged_in_finds_the_mode_by_the_first_line():
    """Within two seconds the board is in the checked mode still; the new connection moves it by sealed lines alone."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        await board.cycles(3)
        bench.device.unplug()
        await asyncio.sleep(0.2)
        bench.device.plug()
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        board.written()
        bench.session.send_duty((50, -40))
        assert set(board.written()) <= {b"s 0 0"}
        await asyncio.sleep(0.02)
        board.cycle()
        bench.session.send_duty((51, -41))
        assert board.bodies()[-1] == b"s 51 -41"
        assert bench.session.firmware.report(0.0).mode == "checked"

    on_own_board(scenario)


def test_the_duty_in_force_is_repeated_while_the_control_loop_lives():
    """The board is not heard, and the loop looks every 20 ms: the duty is written again every 60 ms at least."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        board.cycle()
        bench.session.send_duty((50, -40))
        for _ in range(50):
            await asyncio.sleep(0.02)
            bench.session.repeat_duty((50, -40))
        said = [stamp_s for stamp_s, line in bench.session.lines.said if line.startswith(b"s 50 -40")]
        assert len(said) > 16
        assert max(after - before for before, after in pairwise(said)) < 0.061

    on_own_board(scenario)


def test_nothing_is_repeated_when_the_control_loop_does_not_ask_for_it():
    """The board goes on with its cycles for half a second: of commands nothing is written, so its dead-man stops it."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        board.cycle()
        bench.session.send_duty((50, -40))
        await board.cycles(1, 50, -40, 1)
        board.written()
        await board.cycles(50, 50, -40, 1)
        assert all(body.startswith(b"hello") for body in board.bodies())

    on_own_board(scenario)


def safety(mode: str) -> events.SafetyChanged:
    """The gate's mode, as it is published."""
    return events.SafetyChanged(0.0, mode, "test", None)


def test_an_estop_latches_on_the_board_and_arming_ends_it():
    """`estop` goes out, again while the board's state does not show it, and `arm` with the board's own number."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        bench.bus.publish(safety("armed"))
        board.say("state\t1\t0\t6\t1")
        board.written()
        bench.bus.publish(safety("estopped"))
        assert board.written() == [b"estop"]
        board.say("state\t1\t0\t6\t1")
        assert board.written() == [b"estop"]
        board.say("state\t1\t2\t7\t1")
        assert board.written() == []
        bench.bus.publish(safety("armed"))
        assert board.bodies() == [b"arm 7"]
        board.say("state\t1\t2\t7\t1")
        assert board.bodies() == [b"arm 7"]
        board.say("state\t1\t0\t7\t1")
        assert board.bodies() == []

    on_own_board(scenario)


def test_arming_in_the_classic_mode_ends_the_boards_stop_once_the_mode_is_checked():
    """Armed once the board is known; 5 s later that agrees, and has a stop latched: `arm` with its number."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        bench.device.feed(NAMED)
        bench.bus.publish(safety("armed"))
        await asyncio.sleep(5.0)
        await board.agree()
        board.written()
        board.say("state\t1\t2\t7\t1")
        assert board.bodies() == [b"arm 7"]
        await board.cycles(120)
        board.written()
        board.say("state\t1\t2\t8\t1")  # a new one, that nobody here asked for
        assert b"arm 8" not in board.bodies()
        assert board.report().stopped_itself

    on_own_board(scenario)


def test_a_robot_that_was_armed_before_its_board_was_heard_does_not_end_the_boards_stop():
    """A daemon that starts armed leaves a stop in force that was latched before: somebody has to arm."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        bench.bus.publish(safety("armed"))
        await board.agree()
        board.written()
        board.say("state\t1\t2\t7\t1")
        assert board.bodies() == []
        assert board.report().stopped_itself

    on_own_board(scenario)


def test_an_estop_of_somebody_else_is_not_ended():
    """The board latches a second after the robot was armed: nothing is written, and the report says who stopped."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        bench.bus.publish(safety("armed"))
        await board.cycles(120)
        board.written()
        board.say("state\t1\t2\t1\t1")
        assert [body for body in board.bodies() if not body.startswith(b"hello")] == []
        report = board.report()
        assert (report.stops, report.stopped_itself) == (("estop",), True)

    on_own_board(scenario)


def test_a_classic_sketch_gets_no_estop_word():
    """Only the zeros that the control loop writes: the word would be undefined there."""

    async def scenario(bench: Bench) -> None:
        bench.device.feed(cycle(0))
        bench.bus.publish(safety("estopped"))
        bench.bus.publish(safety("armed"))
        assert bytes(bench.device.written) == OPENING

    on_bench(scenario)


def test_a_reset_is_sealed_in_the_checked_mode():
    """The dance is the same: stop, wait until echo and wheels stand, then `r` with its number and CRC."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        bench.session.reset_board()
        board.written()
        await board.cycles(20)
        assert unseal(board.written()[-1], b" ") is not None
        await board.cycles(1)

    on_own_board(scenario)


def test_the_classic_setting_never_greets():
    """`[link] firmware = "classic"`: a board that names itself is driven as a classic sketch."""

    async def scenario(bench: Bench) -> None:
        session = BoardSession(
            bench.bus,
            LoopClock(),
            CLASSIC,
            device="/dev/other",
            setpoints_per_s=200.0,
            negotiates=False,
        )
        await bench.device.open(LinkParameters(), session)
        await asyncio.sleep(0)
        bench.device.written.clear()
        for number in range(100):
            bench.device.feed(NAMED + cycle(number))
            await asyncio.sleep(0.02)
        session.send_duty((5, 6))
        assert bytes(bench.device.written) == b"s 5 6\r"

    on_bench(scenario)


def test_the_boards_counters_are_reported():
    """CRC errors, refused lines, overruns, gaps, dead-man stops and late cycles, as the board counts them."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        board.say("counters\t1\t2\t3\t4\t5\t6")
        report = board.report()
        counted = report.crc_errors, report.refused, report.overruns, report.gaps
        assert (*counted, report.deadman_stops, report.late_cycles) == (1, 2, 3, 4, 5, 6)

    on_own_board(scenario)


def test_a_stop_that_overtakes_is_written_twice_without_a_seal():
    """The board does not read: the duty that waits is dropped, and two plain stops go instead of it."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        board.cycle()
        bench.session.send_duty((50, -40))
        board.written()
        transport = bench.device.transport
        assert transport is not None
        transport.stall()
        transport.write(b"s 6")
        bench.session.send_duty((0, 0))
        transport.drain()
        assert bytes(bench.device.written) == 2 * STOP

    on_own_board(scenario)


def test_an_answer_with_another_dead_man_than_asked_for_is_a_complaint():
    """2000 ms in place of 250: the report has what the board says, and that it is not what was asked for."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await asyncio.sleep(0.1)
        bench.device.feed(NAMED)
        board.say("hello\t1\t2000\t100\t0")
        report = board.report()
        assert report.deadman_ms == 2000
        assert report.reason == (
            "the board answered with protocol 1 and a dead-man of 2000 ms, where protocol 1 and 250 ms were asked for"
        )

    on_own_board(scenario)


def test_checked_lines_without_an_answer_to_a_hello_are_a_complaint():
    """The mode goes on, but nobody knows when the board stops by itself: said after three hellos, 0.9 s."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await asyncio.sleep(0.1)
        bench.device.feed(NAMED)
        await board.cycles(200)
        report = board.report()
        assert (report.mode, report.deadman_ms) == ("checked", None)
        assert report.reason.startswith("the board sends checked lines, but answered none of 3 hellos")

    on_own_board(scenario)


def test_a_flood_of_states_is_answered_by_one_stop_in_a_tenth_of_a_second():
    """An e-stop that the board does not latch: 500 of its states in one read, and one a 0.1 s later."""

    async def scenario(bench: Bench, board: OwnBoard) -> None:
        await board.agree()
        await board.cycles(3)
        safety = {"reason": "", "source": None}
        bench.bus.publish(events.SafetyChanged(0.0, mode="estopped", **safety))
        board.written()
        board.say(*["state\t1\t0\t0\t1"] * 500)
        assert board.written().count(b"estop") == 1
        await board.cycles(11)
        board.say("state\t1\t0\t0\t1")
        assert board.written().count(b"estop") == 1

    on_own_board(scenario)


def conditions(bench: Bench, health: Inbox[events.LinkHealthChanged]) -> list[tuple[str, str]]:
    """What is judged of the link since the last call, and why."""
    bench.session.judge_health()
    judged = [health.take_event() for _ in range(len(health))]
    return [(event.condition, event.reason) for event in judged]


def test_our_firmware_gets_no_motion_while_a_sketchs_counts_are_configured():
    """It counts four times 4200: from its name on, duties are stops, the ceiling is 0, and the link says what to set."""

    async def scenario(bench: Bench) -> None:
        board = OwnBoard(bench)
        health = bench.bus.subscribe(events.LinkHealthChanged)
        bench.session.send_duty((60, 61))
        assert board.written()[-1] == b"s 60 61"
        await board.agree()
        await board.cycles(100)
        board.written()
        bench.session.send_duty((50, 51))
        assert board.written() == [b"s 0 0"]
        assert bench.session.duty_ceiling(0.0) == (0, 0)
        ((condition, reason),) = conditions(bench, health)
        assert condition == "counts_differ"
        assert (
            "encoders as counted by the firmware, then calibrate them by turning a wheel ten times" in reason
        )
        assert (
            "Only if the configured counts were measured with the sketch, and not assumed, are they 16800"
            in reason
        )

    on_bench(scenario, counting=Counting(4200.0, by_firmware=False))


def test_a_sketch_gets_no_motion_while_our_firmwares_counts_are_configured():
    """It would be driven four times as fast: all duties are stops, and the link says what to set."""

    async def scenario(bench: Bench) -> None:
        health = bench.bus.subscribe(events.LinkHealthChanged)
        for number in range(120):
            await asyncio.sleep(0.02)
            bench.device.feed(cycle(number))
            bench.session.send_duty((50, 51))
        assert set(bytes(bench.device.written).split(b"\r")[:-1]) == {b"s 0 0"}
        assert bench.session.duty_ceiling(0.0) == (0, 0)
        ((condition, reason),) = conditions(bench, health)
        assert condition == "counts_differ"
        assert "encoders as counted by the sketch, then calibrate them by turning a wheel ten times" in reason
        assert "measured with our firmware, and not assumed, are they 4200" in reason

    on_bench(scenario, counting=Counting(16_800.0, by_firmware=True))


@pytest.mark.parametrize("by_firmware", [True, False])
def test_a_board_that_counts_as_is_configured_drives(by_firmware: bool):
    """Our firmware in its checked mode; a sketch at once."""

    async def scenario(bench: Bench) -> None:
        board = OwnBoard(bench)
        if by_firmware:
            bench.session.send_duty((50, 51))
            assert board.written()[-1] == b"s 0 0"
            await board.agree()
            board.cycle()
        bench.session.send_duty((50, 51))
        assert board.bodies()[-1] == b"s 50 51"
        assert bench.session.duty_ceiling(0.0) is None

    on_bench(scenario, counting=Counting(4200.0, by_firmware=by_firmware))
