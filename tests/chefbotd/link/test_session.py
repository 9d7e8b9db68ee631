"""The session: bytes to events, duties to bytes."""

import asyncio

import pytest
from structlog.testing import capture_logs

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core import events
from chefbotd.link.port import LinkParameters
from firmware_protocol import messages as wire
from tests.chefbotd.link.bench import OPENING, STOP, Bench, cycle, on_bench


def test_opening_puts_a_stop_on_the_wire():
    """Whatever the board was doing before: the first line it gets is a stop."""

    async def scenario(bench: Bench) -> None:
        assert bytes(bench.device.written) == OPENING
        assert bench.session.is_open

    on_bench(scenario)


def test_half_a_line_in_the_boards_buffer_does_not_spoil_the_first_stop():
    """Whoever had the port before was killed within `s 203 -201`: the board stands after the opening all the same."""

    async def run() -> None:
        bench = Bench()
        bench.device.on_write(b"s 203 -201\rs 203 -2")
        assert bench.board.duty == (203, -201)
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        assert bench.board.duty == (0, 0)

    run_virtual(run())


def test_every_line_of_a_cycle_becomes_its_event():
    """One cycle `t e u s i b` in one chunk: each frame is an event stamped with the time of reading."""

    async def scenario(bench: Bench) -> None:
        bench.board.say(
            wire.BoardTime(20_000, 0.02),
            wire.EncoderCounts((5, -6)),
            wire.UltrasonicDistance(123),
            wire.DutyEcho((10.0, -10.0)),
            wire.Orientation(0.0, 0.0, 0.71, 0.71),
            wire.RawImu((1, 2, 3), (4, 5, 6)),
            wire.BatteryLevel(3000.0),
        )
        now = LoopClock().now_s()
        assert bench.heard() == [
            events.EncodersCounted(now, now, now, (5, -6)),
            events.UltrasonicEchoed(now, now, 123),
            events.DutyEchoed(now, now, (10.0, -10.0)),
            events.OrientationReported(now, now, 0.0, 0.0, 0.71, 0.71),
            events.InertialCounted(now, now, (1, 2, 3), (4, 5, 6)),
            events.BatteryCounted(now, now, 3000.0),
        ]

    on_bench(scenario)


def test_encoders_carry_their_cycles_board_time():
    """Two cycles 20 ms apart by the board, read 35 ms apart: the counts are 20 ms apart in board time."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(0, 0, cycle_s=0.02)
        await asyncio.sleep(0.035)
        bench.board.cycle(10, 10, cycle_s=0.02)
        first, second = bench.heard()
        assert second.board_s - first.board_s == pytest.approx(0.02)
        assert second.arrival_s - first.arrival_s == pytest.approx(0.035)

    on_bench(scenario)


def test_a_restart_is_noticed_by_the_banner():
    """The first banner line after frames says that the board restarted; the rest of the banner is only text."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(100, 100)
        bench.heard()
        bench.board.say(
            wire.ResetDone(),
            wire.Banner("Initializing I2C devices..."),
            wire.Banner("Testing device connections..."),
        )
        kinds = [type(event) for event in bench.heard()]
        assert kinds == [events.TextReceived, events.BoardRestarted, events.TextReceived, events.TextReceived]
        assert bench.session.restarts.memory.count == 1

    on_bench(scenario)


def test_a_restart_without_a_banner_is_noticed_by_the_clock():
    """Time near zero, twice in a row, after a minute of running: a restart, told before that cycle's counts."""

    async def scenario(bench: Bench) -> None:
        bench.board.say(wire.BoardTime(60_000_000, 0.02), wire.EncoderCounts((100, 100)))
        await asyncio.sleep(1.0)
        bench.board.say(wire.BoardTime(500_000, 0.02), wire.EncoderCounts((0, 0)))
        await asyncio.sleep(0.02)
        bench.board.say(wire.BoardTime(520_000, 0.02), wire.EncoderCounts((1, 1)))
        kinds = [type(event) for event in bench.heard()]
        assert kinds == [events.EncodersCounted, events.BoardRestarted, events.EncodersCounted]

    on_bench(scenario)


def test_text_and_refused_lines_are_told_apart_and_counted():
    """Text is passed on; a malformed line is passed on with its reason; both are counted."""

    async def scenario(bench: Bench) -> None:
        bench.board.say(b"hello\r\ne\t12\n", wire.UltrasonicDistance(7))
        text, refused, _ = bench.heard()
        assert text.text == "hello"
        assert (refused.reason, refused.line) == ("field_count", b"e\t12")
        assert bench.session.refused == {"field_count": 1}
        assert bench.session.frames == {"Text": 1, "UltrasonicDistance": 1}

    on_bench(scenario)


def test_raw_lines_are_seen_in_both_directions_while_someone_listens():
    """With a subscriber every line in and out is an event, as it stood on the wire."""

    async def scenario(bench: Bench) -> None:
        bench.board.say(wire.UltrasonicDistance(7))
        raw = bench.bus.subscribe(events.LineSeen)
        bench.board.say(wire.UltrasonicDistance(8))
        await asyncio.sleep(1.0)
        bench.session.send_duty((5, -5))
        seen = [raw.take_event() for _ in range(len(raw))]
        assert [(str(e.direction), e.line) for e in seen] == [("in", b"u\t8"), ("out", b"s 5 -5")]

    on_bench(scenario)


def test_a_board_whose_echo_stands_still_is_told_nothing_faster():
    """It talks and the kernel takes all, but its echo stands still for 0.2 s: only slower goes, until it moves."""

    async def scenario(bench: Bench) -> None:
        bench.session.send_duty((-5, 5))
        bench.board.say(wire.DutyEcho((-5.0, 5.0)))
        for number in range(6, 46):
            bench.session.send_duty((-number, 2 * number))
            bench.board.cycle(0, 0)
            bench.board.say(wire.DutyEcho((-5.0, 5.0)))
            await asyncio.sleep(0.02)
        held = bench.board.duty
        assert held == bench.session.duty_ceiling(LoopClock().now_s())
        assert -18 <= held[0] <= -15
        bench.session.send_duty((held[0] + 2, held[1] - 3))
        assert bench.board.duty == (held[0] + 2, held[1] - 3)
        bench.session.send_duty((-45, 90))
        bench.board.say(wire.DutyEcho((float(held[0] + 2), float(held[1] - 3))))
        assert bench.board.duty == (-45, 90)

    on_bench(scenario)


def test_a_board_that_does_not_read_gets_the_newest_command_only():
    """While it is stalled one line is in the buffer and one waits; reading again it gets those two, not ten."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.device.transport.stall()
        for number in range(1, 11):
            bench.session.send_duty((number, number))
            await asyncio.sleep(0.02)
        bench.device.transport.drain()
        await asyncio.sleep(0.1)
        assert bytes(bench.device.written) == OPENING + b"s 1 1\rs 10 10\r"
        assert bench.session.setpoints.replaced == 8

    on_bench(scenario)


def test_closing_sends_a_stop_first():
    """The last line on the wire of a link that we close is a stop."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.session.send_duty((100, 100))
        bench.session.close()
        await asyncio.sleep(0)
        assert bytes(bench.device.written) == OPENING + b"s 100 100\r" + 4 * STOP
        assert isinstance(bench.heard()[-1], events.LinkClosed)
        assert not bench.session.is_open

    on_bench(scenario)


def test_a_stop_overtakes_what_is_unsent():
    """Behind a board that does not read: the line under way is dropped, and so is the motion that waits behind it."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.device.transport.stall()
        bench.session.send_duty((1, 1))
        bench.session.send_duty((2, 2))
        bench.session.stop_motors()
        bench.session.stop_motors()
        bench.device.transport.drain()
        await asyncio.sleep(1.0)
        assert bytes(bench.device.written) == OPENING + 2 * STOP

    on_bench(scenario)


def test_closing_behind_a_board_that_does_not_read_leaves_it_nothing_but_stops():
    """Neither the line under way nor the motion that waits is read, however late: four stops are."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        transport = bench.device.transport
        transport.stall()
        bench.session.send_duty((1, 1))
        bench.session.send_duty((2, 2))
        bench.session.close()
        bench.session.send_duty((3, 3))
        await asyncio.sleep(1.0)
        transport.drain()
        assert bytes(bench.device.written) == OPENING + 4 * STOP

    on_bench(scenario)


def test_without_a_link_commands_vanish_quietly():
    """Before the first and after the last connection a duty, a stop and a reset do nothing."""

    async def scenario(bench: Bench) -> None:
        bench.device.unplug()
        await asyncio.sleep(0)
        before = bytes(bench.device.written)
        bench.session.send_duty((1, 1))
        bench.session.reset_board()
        bench.session.close()
        await asyncio.sleep(1.0)
        assert bytes(bench.device.written) == before
        assert "readiness" in bench.heard()[-1].reason

    on_bench(scenario)


def test_a_board_that_went_on_counting_while_unplugged_is_not_restarted():
    """The cable was out for 2 s and the board's clock went on for 2 s: no restart, the counts go on."""

    async def scenario(bench: Bench) -> None:
        bench.board.say(wire.BoardTime(1_000_000, 0.02), wire.EncoderCounts((5, 5)))
        bench.device.unplug()
        await asyncio.sleep(2.0)
        bench.device.plug()
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        bench.board.say(wire.BoardTime(3_000_000, 0.02), wire.EncoderCounts((9, 9)))
        first, second = (e for e in bench.heard() if isinstance(e, events.EncodersCounted))
        assert second.board_s - first.board_s == pytest.approx(2.0)
        assert bench.session.restarts.memory.count == 0
        assert bench.session.memory.opens == 2

    on_bench(scenario)


def test_half_a_line_does_not_survive_a_reconnection():
    """What was cut by the unplug is not glued to what comes after the replug."""

    async def scenario(bench: Bench) -> None:
        bench.board.say(b"u\t1")
        bench.device.unplug()
        bench.device.plug()
        await asyncio.sleep(0)
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        bench.heard()
        bench.board.say(b"u\t23\n")
        assert [event.distance_cm for event in bench.heard()] == [23]

    on_bench(scenario)


def test_the_first_stops_are_told_and_take_their_room():
    """Of 63 bytes 12 are the two first stops; with two lines of 10 bytes, 32: a third, for a change, would want 64."""

    async def run() -> None:
        bench = Bench()
        said = bench.bus.subscribe(events.DutyWritten)
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        assert said.take_event().duty == (0, 0)
        for number in (10, 20, 30):
            bench.session.send_duty((number, -200))
            await asyncio.sleep(0.02)
        assert [said.take_event().duty for _ in range(len(said))] == [(10, -200), (20, -200)]

    run_virtual(run())


def test_after_a_restart_the_boards_buffer_is_empty():
    """It is full of what it never read; its banner says that it began anew, and the next command goes at once."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(0, 0)
        for number in range(10, 90, 10):
            bench.session.send_duty((number, -200))
            await asyncio.sleep(0.02)
        assert bench.board.duty != (80, -200)
        bench.board.say(b"Initializing I2C devices...\r\n")
        bench.session.send_duty((90, -200))
        assert bench.board.duty == (90, -200)

    on_bench(scenario)


def test_what_was_heard_is_kept_for_the_log():
    """Each line with the time it was read."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(0.3)
        bench.board.say(b"u\t87\nb\t30x\n")
        now_s = LoopClock().now_s()
        assert list(bench.session.lines.heard) == [(now_s, [b"u\t87", b"b\t30x"])]

    on_bench(scenario)


def test_what_the_port_sounds_like_is_published_and_logged():
    """Silent after two seconds, which is logged; healthy once it talks, which is not."""

    async def scenario(bench: Bench) -> None:
        changes = bench.bus.subscribe(events.LinkHealthChanged)
        await asyncio.sleep(2.1)
        with capture_logs() as log:
            bench.session.judge_health()
            silent = changes.take_event()
            assert (silent.healthy, silent.condition) == (False, "silent")
            assert [entry["event"] for entry in log] == ["the link to the board is not healthy"]
            for number in range(200):
                bench.session.data_received(cycle(number))
                await asyncio.sleep(0.02)
                bench.session.judge_health()
            well = changes.take_event()
            assert (well.healthy, well.condition, well.reason) == (True, "healthy", "")
            assert len(log) == 1

    on_bench(scenario)


def test_nothing_is_said_to_a_lost_port():
    """Closing writes the last stops to a port that is there, and none where it was pulled before."""

    async def scenario(bench: Bench) -> None:
        before = bench.session.writer.memory.lines_out
        bench.session.connection_lost(OSError("unplugged"))
        bench.session.close()
        assert bench.session.writer.memory.lines_out == before

    on_bench(scenario)


def test_before_the_first_port_nobody_waits_for_its_end():
    """Nothing was opened, so nothing has to be closed."""

    async def run() -> None:
        await asyncio.wait_for(Bench().session.wait_closed(), 1.0)

    run_virtual(run())
