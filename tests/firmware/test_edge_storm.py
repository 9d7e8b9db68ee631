"""A loose encoder wire makes more edges than a processor can count: the board sheds them, and everything else goes on.

On the image in simavr, where the encoders' interrupts come before the tick's: without the shedding the tick starves, the
watchdog resets the part, and the boot loader of this board does not come back from that.
"""

import pytest

from chefbotd.components.simulation.simavr import CYCLES_S
from tests.firmware import host
from tests.firmware.emulator import EDGES_STEP_S, Emulated

LEFT_STORM, RIGHT_STORM = 32, 64
STORM_S = 0.3


class Loose:
    """A board in the checked mode, with wires that may come loose."""

    def __init__(self) -> None:
        self.board = Emulated()
        self.board.hello(250)
        self.board.seal("s 100 -100")
        self.board.run(0.05)
        self.board.forget()
        self._level = [0, 0]

    def storm(
        self, seconds: float, rates: dict[tuple[int, str], int], *, turns: int = 0, feeds: bool = True
    ) -> None:
        """Channels toggle at so many edges a second, while the right wheel turns evenly and the host goes on."""
        for step in range(round(seconds / EDGES_STEP_S)):
            if feeds and step % 10 == 0:
                self.board.seal("s 100 -100")
            begin = self.board.now_s
            for (wheel, channel), rate in rates.items():
                self._toggle(wheel, channel, rate, begin)
            self.board.run(EDGES_STEP_S, edges_s=(0, turns))

    def _toggle(self, wheel: int, channel: str, rate: int, begin_s: float) -> None:
        count = round(rate * EDGES_STEP_S)
        # Forward of a wheel: A, then B. A alone goes to and fro between 0 and 1, B alone between 1 and 2.
        low = 0 if channel == "A" else 1
        for edge in range(count):
            at = round((begin_s + EDGES_STEP_S * (edge + 0.5) / count) * CYCLES_S)
            before, self._level[wheel] = self._level[wheel], 1 - self._level[wheel]
            self.board.board.turn(wheel, low + before, low + self._level[wheel], at - 1, at)

    @property
    def state(self) -> list[str]:
        """Mode, stops, e-stop, cause."""
        return self.board.fields("state")[-1]

    @property
    def has_restarted(self) -> bool:
        """Whether its banner came since the storm began."""
        return "Initializing" in self.board.text


@pytest.mark.parametrize(
    ("wheel", "channel", "rate"),
    [
        *[(*each, 150_000) for each in ((0, "A"), (1, "A"), (0, "B"), (1, "B"))],
        (0, "A", 40_000),
        (1, "B", 300_000),
    ],
)
def test_a_storm_on_a_channel_stops_the_motors_and_is_named(wheel: int, channel: str, rate: int) -> None:
    """Off within 20 ms, both; it restarts nothing, and the state names the wheel.

    Pulses of B that are over before they are read could be either wheel's, as both share an interrupt: both are named.
    """
    loose = Loose()
    begun_s = loose.board.now_s
    loose.storm(STORM_S, {(wheel, channel): rate})
    assert not loose.has_restarted
    assert loose.board.changed_s((0, 0), begun_s) - begun_s < 0.02
    assert loose.board.board.duty == (0, 0)
    named = int(loose.state[1]) & (LEFT_STORM | RIGHT_STORM)
    assert named & (LEFT_STORM, RIGHT_STORM)[wheel]
    assert rate > 150_000 or named == (LEFT_STORM, RIGHT_STORM)[wheel]


def test_all_four_channels_at_once_leave_the_board_alive() -> None:
    """600,000 edges a second: cycles go on 100 times a second, an `estop` is heard, nothing restarts."""
    loose = Loose()
    rates = {(wheel, channel): 150_000 for wheel in (0, 1) for channel in "AB"}
    loose.storm(STORM_S, rates)
    loose.board.forget()
    loose.board.write("estop")
    loose.storm(STORM_S, rates)
    assert not loose.has_restarted
    assert len(loose.board.fields("t")) >= 29
    assert int(loose.state[1]) & 2


def test_the_dead_man_holds_in_a_storm_that_is_just_let_through() -> None:
    """15,000 edges a second on each channel of a wheel: 0.25 s after the last duty the motors are off, within 4 ms."""
    loose = Loose()
    fed_s = loose.board.seal("s 90 90")
    loose.storm(0.4, {(0, "A"): 15_000, (1, "A"): 15_000}, feeds=False)
    assert loose.board.changed_s((0, 0), fed_s) - fed_s < 0.254
    assert not loose.has_restarted


def test_the_other_wheel_is_counted_without_a_loss() -> None:
    """5,000 edges a second of the right wheel, 0.3 s long, beside 150,000 of a loose left wire."""
    loose = Loose()
    before = int(loose.board.fields("e")[-1][1]) if loose.board.fields("e") else 0
    loose.storm(STORM_S, {(0, "A"): 150_000}, turns=5_000)
    loose.board.run(0.03)
    assert int(loose.board.fields("e")[-1][1]) - before == loose.board.turned[1]


def test_a_wire_that_holds_again_is_counted_again_after_a_second() -> None:
    """The stop ends by `s 0 0` once the channel is open, not before; then a wheel's turn is counted edge by edge."""
    loose = Loose()
    loose.storm(0.1, {(0, "B"): 150_000})
    loose.board.seal("s 0 0")
    loose.board.seal("s 50 50")
    loose.board.run(0.05)
    assert loose.board.board.duty == (0, 0)
    loose.board.run(1.0)
    loose.board.seal("s 0 0")
    loose.board.seal("s 50 50")
    loose.board.run(0.05)
    assert loose.board.board.duty == (50, 50)
    before = int(loose.board.fields("e")[-1][0])
    turned = loose.board.turned[0]
    loose.board.run(0.1, edges_s=(4_000, 0))
    loose.board.run(0.03)
    counted = int(loose.board.fields("e")[-1][0]) - before
    assert abs(counted - (loose.board.turned[0] - turned)) <= 2  # the wire's last level


def test_a_shut_encoder_stops_the_host_build_too(board: host.Board) -> None:
    """The core's part: stopped as long as it is shut, tried again after a second, ended by a stop after that."""
    board.hello(2000)
    board.seal("s 90 90")
    board.fake.shut = 2
    board.run(0.001)
    assert board.duty == (0, 0)
    board.run(0.02)
    assert int(board.bodies("state")[-1][2]) == RIGHT_STORM
    board.seal("s 0 0")
    number = board.seal("s 90 90")
    assert ["refused", "4", str(number)] in board.bodies("refused")
    board.run(1.0)
    assert (board.fake.opened, board.fake.shut) == (1, 0)
    board.seal("s 0 0")
    board.seal("s 90 90")
    assert board.duty == (90, 90)
