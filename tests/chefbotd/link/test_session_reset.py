"""The reset of a board from the host: when it is sent, and how it ends."""

import asyncio

from chefbotd.clock import LoopClock
from chefbotd.core import events
from chefbotd.link.port import LinkParameters
from firmware_protocol import messages as wire
from firmware_protocol.codec import KHAN_EDGES
from tests.chefbotd.link.bench import OPENING, Bench, on_bench


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
        assert bench.session.restarts.memory.count == 1
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
        assert bench.session.restarts.memory.count == 0
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
        assert bench.session.restarts.memory.count == 1

    on_bench(scenario)


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


def test_a_reset_of_a_board_of_edges_waits_until_its_wheels_stand():
    """Four totals a cycle say how far they turned: ``r`` goes 0.1 s after the rear right wheel's last edge."""

    async def scenario(bench: Bench) -> None:
        await asyncio.sleep(1.0)
        bench.session.reset_board()
        for number in range(14):
            await asyncio.sleep(0.02)
            rear_right = 4 * min(number, 7)
            totals = (500, 65_530, 3, rear_right)
            lines = b"".join(b"q\t%d\t%d\n" % (wheel, total) for wheel, total in enumerate(totals))
            assert b"r" not in bytes(bench.device.written) or number == 13
            bench.session.data_received(lines + b"t\t%d\t0.02\n" % (1_000_000 + number * 20_000))
            bench.board.say(wire.DutyEcho((0.0, 0.0, 0.0, 0.0)))
        assert bytes(bench.device.written).endswith(b"\rr\r")

    on_bench(scenario, KHAN_EDGES)
