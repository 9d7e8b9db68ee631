"""The session: bytes to events, duties to bytes."""

import asyncio
from collections.abc import Awaitable, Callable
from itertools import pairwise

import pytest

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core import events
from chefbotd.link.port import LinkParameters
from chefbotd.link.session import BoardSession
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol import messages as wire
from firmware_protocol.codec import CLASSIC

EVERYTHING = (
    events.LinkOpened,
    events.LinkClosed,
    events.BoardResetProgressed,
    events.BoardRestarted,
    events.LineRefused,
    events.TextReceived,
    events.EncodersCounted,
    events.UltrasonicEchoed,
    events.DutyEchoed,
    events.OrientationReported,
    events.InertialCounted,
    events.BatteryCounted,
)


STOP = b"s 0 0\r"
OPENING = 2 * STOP
"""A line that was cut short by what was before takes the first of them with it."""


class Bench:
    """A session on a fake device, with an inbox for everything it publishes."""

    def __init__(self) -> None:
        self.bus = Bus()
        self.device = FakeSerialDevice()
        self.board = ScriptedBoard(self.device)
        self.session = BoardSession(self.bus, LoopClock(), CLASSIC, device="/dev/fake", setpoints_per_s=200.0)
        self.inbox: Inbox[object] = self.bus.subscribe(*EVERYTHING)

    def heard(self) -> list[object]:
        """Everything published since the last call."""
        return [self.inbox.take() for _ in range(len(self.inbox))]


def on_bench(scenario: Callable[[Bench], Awaitable[None]]) -> None:
    """Run a scenario with the device open, on the virtual clock."""

    async def run() -> None:
        bench = Bench()
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        assert isinstance(bench.inbox.take(), events.LinkOpened)
        await scenario(bench)

    run_virtual(run())


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


def cycle(number: int) -> bytes:
    """The `t`, `e` and `u` lines of a cycle of 20 ms."""
    return b"t\t%d\t0.02\ne\t%d\t%d\nu\t87\n" % (5_000_000 + number * 20_000, number * 3, number * -2)


def test_what_waited_on_the_way_is_stamped_with_when_it_was_measured():
    """Sixty cycles are read as they come; three then wait until they are read at once, 53 ms after the first of them."""

    async def scenario(bench: Bench) -> None:
        start_s = LoopClock().now_s()
        for number in range(60):
            bench.session.data_received(cycle(number))
            await asyncio.sleep(0.02)
        bench.heard()
        await asyncio.sleep(0.053)
        bench.session.data_received(cycle(60) + cycle(61) + cycle(62))
        events_ = bench.heard()
        counted = [event for event in events_ if isinstance(event, events.EncodersCounted)]
        echoed = [event for event in events_ if isinstance(event, events.UltrasonicEchoed)]
        assert [each.stamp_s - start_s for each in counted] == pytest.approx([1.20, 1.22, 1.24])
        assert [each.stamp_s - start_s for each in echoed] == pytest.approx([1.20, 1.22, 1.24])
        assert [each.arrival_s - start_s for each in events_] == pytest.approx([1.253] * 6)

    on_bench(scenario)


def test_a_cycle_whose_time_was_damaged_is_stamped_as_late_as_the_one_before():
    """Its counts come 21 ms after a `t` that was on time."""

    async def scenario(bench: Bench) -> None:
        for number in range(60):
            bench.session.data_received(cycle(number))
            await asyncio.sleep(0.02)
        bench.heard()
        await asyncio.sleep(0.001)
        bench.session.data_received(b"t\t62x0000\t0.02\ne\t181\t-121\n")
        _, counted = bench.heard()
        assert counted.stamp_s == pytest.approx(counted.arrival_s)

    on_bench(scenario)


def test_a_board_without_a_clock_has_its_lines_stamped_by_even_cycles():
    """Four `e` lines a read, 16 ms apart: none is stamped after the read, the first a cycle or more before it."""

    async def scenario(bench: Bench) -> None:
        for number in range(0, 400, 4):
            await asyncio.sleep(0.016)
            lines = b"".join(b"e\t%d\t%d\n" % (k, -k) for k in range(number, number + 4))
            bench.session.data_received(lines + b"u\t41\n")
        *_, first, second, third, last, echoed = bench.heard()
        assert second.stamp_s - first.stamp_s == pytest.approx(0.004, abs=1e-4)
        assert first.stamp_s <= first.arrival_s - 0.004
        assert second.stamp_s <= third.stamp_s <= last.stamp_s <= last.arrival_s
        assert echoed.stamp_s == echoed.arrival_s == last.arrival_s

    on_bench(scenario)


def test_encoders_without_a_time_line_are_timed_by_the_host():
    """The second cycle's `t` was lost: its counts are placed by how long the host waited."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(0, 0)
        await asyncio.sleep(0.021)
        bench.board.say(wire.EncoderCounts((10, 10)))
        first, second = bench.heard()
        assert second.board_s - first.board_s == pytest.approx(0.021)

    on_bench(scenario)


def test_counts_of_a_doubtful_cycle_wait_for_the_next():
    """A `t` line that lost digits: its cycle's counts are not passed on; the next cycle's are, and nothing is lost."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(0, 0)
        await asyncio.sleep(0.02)
        bench.board.say(b"t\t4000000004\t0.02\n", wire.EncoderCounts((10, 10)))
        await asyncio.sleep(0.02)
        bench.board.say(wire.BoardTime(60_000, 0.02), wire.EncoderCounts((20, 20)))
        assert [event.counts for event in bench.heard()] == [(0, 0), (20, 20)]

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
        assert bench.session.board_restarts == 1

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
        seen = [raw.take() for _ in range(len(raw))]
        assert [(str(e.direction), e.line) for e in seen] == [("in", b"u\t8"), ("out", b"s 5 -5")]

    on_bench(scenario)


def told(bench: Bench) -> list[str]:
    """The stages of a restart that were published since the last call."""
    return [event.stage for event in bench.heard() if isinstance(event, events.BoardResetProgressed)]


def test_a_reset_waits_until_the_stop_is_in_force():
    """``r`` goes when the echo has said zero twice, and no motion from the request on until the board is back.

    The wheels stand all the while.
    """

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.session.send_duty((100, -80))
        bench.session.reset_board()
        for echo in (*[(100.0, -80.0)] * 8, (0.0, 0.0), (0.0, 0.0)):
            await asyncio.sleep(0.02)
            bench.session.send_duty((70, 60))
            assert b"r" not in bytes(bench.device.written)
            bench.board.cycle(500, -400)
            bench.board.say(wire.DutyEcho(echo))
        assert bytes(bench.device.written).endswith(b"\rr\r")
        assert told(bench) == ["stopping", "asked"]
        await asyncio.sleep(1.0)
        bench.session.send_duty((70, 60))
        assert bench.session.duty_ceiling(LoopClock().now_s()) == (0, 0)
        assert {duty for _, duty in bench.board.duties} == {(100, -80), (0, 0)}

    on_bench(scenario)


def test_a_reset_waits_until_the_wheels_stand():
    """The echo is zero and the wheels roll on for 0.2 s, the right one longer: ``r`` goes 0.1 s after its last count.

    What they turn while the sketch waits for its reset is in no count. An encoder at rest that dithers by three stands.
    """

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.session.reset_board()
        left, right = 2000, -700
        for cycle in range(10):
            await asyncio.sleep(0.02)
            left, right = left + (30 if cycle < 4 else 0), right - 9
            bench.board.cycle(left, right)
            bench.board.say(wire.DutyEcho((0.0, 0.0)))
        for cycle in range(6):
            assert b"r" not in bytes(bench.device.written) or cycle == 5
            await asyncio.sleep(0.02)
            bench.board.cycle(left + cycle % 2 * 3, right)
            bench.board.say(wire.DutyEcho((0.0, 0.0)))
        assert bytes(bench.device.written).endswith(b"\rr\r")
        assert told(bench) == ["stopping", "asked"]

    on_bench(scenario)


def test_a_reset_of_a_robot_that_goes_on_rolling_goes_all_the_same():
    """Downhill, or pushed: the echo has said zero since long, and after 1.5 s the board is asked."""

    async def scenario(bench: Bench) -> None:
        bench.session.reset_board()
        for cycle in range(78):
            assert b"r" not in bytes(bench.device.written) or cycle >= 75
            await asyncio.sleep(0.02)
            bench.board.cycle(900 + 20 * cycle, -35 * cycle)
            bench.board.say(wire.DutyEcho((0.0, 0.0)))
        assert bytes(bench.device.written).endswith(b"\rr\r")

    on_bench(scenario)


def test_a_reset_ends_when_the_board_is_back():
    """Its banner comes: restarted, and the next command goes to the board."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(500, 400)
        bench.session.reset_board()
        for _ in range(7):
            await asyncio.sleep(0.02)
            bench.board.cycle(500, 400)
            bench.board.say(wire.DutyEcho((0.0, 0.0)))
        bench.board.say(wire.ResetDone())
        await asyncio.sleep(1.2)
        bench.board.say(wire.Banner("Initializing I2C devices..."))
        assert told(bench) == ["stopping", "asked", "restarted"]
        assert bench.session.board_restarts == 1
        bench.session.send_duty((70, 60))
        assert bench.board.duty == (70, 60)
        assert bench.session.duty_ceiling(LoopClock().now_s()) is None

    on_bench(scenario)


def test_a_reset_of_a_board_that_does_not_echo_goes_all_the_same():
    """Without an echo the stop has 1.5 s; without an answer the board has 5 s to be back. Then it may be driven."""

    async def scenario(bench: Bench) -> None:
        bench.session.reset_board()
        await asyncio.sleep(1.4)
        assert b"r" not in bytes(bench.device.written)
        await asyncio.sleep(0.2)
        assert bytes(bench.device.written).endswith(b"r\r")
        await asyncio.sleep(4.8)
        assert told(bench) == ["stopping", "asked"]
        await asyncio.sleep(0.3)
        assert told(bench) == ["no_answer"]
        bench.session.send_duty((70, 60))
        assert bench.board.duty == (70, 60)

    on_bench(scenario)


def test_a_board_that_says_reset_done_and_goes_on_is_told_as_such():
    """The sketch for the Arduino: three more cycles after `Reset Done`, and the restart has not happened."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(500, 400)
        bench.session.reset_board()
        for _ in range(7):
            await asyncio.sleep(0.02)
            bench.board.cycle(500, 400)
            bench.board.say(wire.DutyEcho((0.0, 0.0)))
        bench.board.say(wire.ResetDone())
        assert told(bench) == ["stopping", "asked"]
        for _ in range(3):
            await asyncio.sleep(0.02)
            bench.board.cycle(500, 400)
        assert told(bench) == ["not_restarted"]
        assert bench.session.board_restarts == 0
        bench.session.send_duty((70, 60))
        assert bench.board.duty == (70, 60)

    on_bench(scenario)


def test_a_reset_behind_a_port_that_takes_nothing_waits_for_it():
    """The stop instead of the line under way, no ``r`` before the port has drained, and no later motion."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.device.transport.stall()
        bench.session.send_duty((1, 2))
        bench.session.reset_board()
        bench.session.send_duty((2, 3))
        await asyncio.sleep(2.0)
        assert bytes(bench.device.written) == OPENING
        bench.device.transport.drain()
        await asyncio.sleep(0.1)
        written = bytes(bench.device.written)
        assert set(written.removesuffix(b"r\r").split(b"\r")) == {b"s 0 0", b""}
        assert written.endswith(b"r\r")

    on_bench(scenario)


def test_reset_done_of_a_board_without_clock_and_banner_is_a_restart():
    """It says `Reset Done`, is silent for a second and begins at zero: told before its counts, and once."""

    async def scenario(bench: Bench) -> None:
        for number in range(20):
            bench.board.say(wire.EncoderCounts((9656 + number, -47 * number)))
            await asyncio.sleep(0.004)
        bench.board.say(wire.ResetDone())
        bench.heard()
        await asyncio.sleep(1.1)
        bench.board.say(wire.EncoderCounts((0, 0)), wire.EncoderCounts((0, 1)))
        kinds = [type(event) for event in bench.heard()]
        assert kinds == [events.BoardRestarted, events.EncodersCounted, events.EncodersCounted]
        assert bench.session.board_restarts == 1

    on_bench(scenario)


def times_of_lines(chunk: int) -> list[float]:
    """Five ``e`` lines every 17 ms from a board without ``t``, in chunks of so many bytes: when each was printed."""
    found: list[float] = []

    async def scenario(bench: Bench) -> None:
        start_s, number = LoopClock().now_s(), 0
        for _ in range(90):
            data = b""
            for _ in range(5):
                number += 1
                data += b"e\t%d\t%d\ns\t0.00\t0.00\n" % (10 * number, 9 * number)
            for start in range(0, len(data), chunk):
                bench.device.feed(data[start : start + chunk])
            await asyncio.sleep(0.017)
            counted = [event for event in bench.heard() if isinstance(event, events.EncodersCounted)]
            found.extend(event.board_s - start_s for event in counted)

    on_bench(scenario)
    return found


def test_lines_of_one_read_are_spread_whatever_their_chunks():
    """From the first second on they are 3.4 ms apart, and byte by byte the very same times come out."""
    whole = times_of_lines(10_000)
    steps = [after - before for before, after in pairwise(whole[300:])]
    assert len(whole) == 450
    assert steps == pytest.approx([0.0034] * len(steps), rel=0.15)
    assert times_of_lines(1) == pytest.approx(whole, abs=1e-9)
    assert times_of_lines(7) == pytest.approx(whole, abs=1e-9)


def test_a_reset_that_could_not_be_sent_is_forgotten_with_the_link():
    """The cable is pulled before it could go: the next connection begins with a stop, and no reset."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.device.transport.stall()
        bench.session.send_duty((1, 1))
        bench.session.reset_board()
        bench.device.unplug()
        await asyncio.sleep(0)
        bench.device.written.clear()
        bench.device.plug()
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0.1)
        bench.session.send_duty((3, 3))
        assert bytes(bench.device.written) == OPENING + b"s 3 3\r"

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
        assert bench.session.setpoints_replaced == 8

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
        assert bench.session.board_restarts == 0
        assert bench.session.opens == 2

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
