"""The image of the Duemilanove in simavr: from boot to a stop, pin by pin."""

import random

import pytest

from tests.firmware.emulator import Emulated
from tests.firmware.limits import RAM_BEGIN, RAM_END

MCUSR_AT, BROWN_OUT_FLAG = 0x54, 1 << 2


def test_the_board_boots_with_its_motors_off_and_says_who_it_is() -> None:
    """Protocol 1, version 0.1, board 1, all but the current (15), power on (1); the duty never leaves 0."""
    board = Emulated()
    assert board.lines[0] == "Initializing I2C devices..."
    assert "firmware\t1\t0\t1\t1\t15\t1" in board.lines
    assert (board.board.duty, board.duties) == ((0, 0), [])


def test_a_sealed_duty_reaches_the_drivers_and_the_dead_man_takes_it_off() -> None:
    """120 and -80 on the PWM pins, and 0 on both 250 ms after the line came in, within 3 ms for tick and pass."""
    board = Emulated()
    board.hello()
    received_s = board.seal("s 120 -80")
    board.run(0.4)
    assert [change.duty for change in board.duties] == [(120, -80), (0, 0)]
    assert board.changed_s((120, -80), 0.0) - received_s < 0.003
    assert board.changed_s((0, 0), received_s) - received_s == pytest.approx(0.25, abs=0.003)


@pytest.mark.parametrize("edges_s", [(11_600, -11_600), (-200, 10_000)])
def test_no_edge_is_lost(edges_s: tuple[int, int]) -> None:
    """Each of both encoders' edges is counted, forward positive on both sides, at 23,200 a second and below."""
    board = Emulated()
    board.hello()
    board.run(1.0, edges_s=edges_s)
    board.forget()
    board.run(0.03)
    assert [int(field) for field in board.fields("e")[-1]] == list(edges_s)


def test_the_echo_is_timed() -> None:
    """An echo of 5800 us is 100 cm, within the 1 cm that 4 us of the clock and an interrupt may take."""
    board = Emulated(echo_us=5_800)
    board.hello()
    board.run(0.2)
    assert int(board.fields("u")[-1][0]) == pytest.approx(100, abs=1)


def test_no_echo_is_0() -> None:
    """Without an echo the distance is 0, and no cycle waits for it."""
    board = Emulated()
    board.hello()
    board.run(0.3)
    assert {fields[0] for fields in board.fields("u")} == {"0"}
    assert len(board.fields("t")) >= 30


def test_the_imu_is_read_over_its_bus() -> None:
    """The six readings of the sensor's registers come out in their order, not older than a cycle and a half."""
    readings = (16_384, -1, 300, -32_768, 32_767, 5)
    board = Emulated(imu=readings)
    board.hello()
    board.run(0.2)
    *counts, age_us = map(int, board.fields("i")[-1])
    assert tuple(counts) == readings
    assert 0 < age_us < 15_000


def test_a_board_without_an_imu_goes_on() -> None:
    """Nobody answers on the bus: no `i`, and cycles as ever."""
    board = Emulated()
    board.hello()
    board.run(0.3)
    assert board.fields("i") == []
    assert len(board.fields("t")) >= 30


def test_the_battery_is_told_in_12_bits() -> None:
    """2.5 V of the ADC's 5 V are half of 4096, within its 10 bits."""
    board = Emulated()
    board.board.set_battery_mv(2_500)
    board.hello()
    board.run(0.5)
    assert int(board.fields("b")[-1][0]) == pytest.approx(2048, abs=4)


def test_the_reset_pin_keeps_the_estop_and_the_power_does_not() -> None:
    """An e-stop is in force after the reset pin (cause 2), and not after the power was off (cause 1)."""
    board = Emulated()
    board.hello()
    board.write("estop")
    board.run(0.05)
    for power_on, state in ((False, ["1", "2", "1", "2"]), (True, ["1", "0", "0", "1"])):
        board.board.reset(power_on=power_on)
        board.run(0.1)
        board.hello(2000)
        board.run(0.25)
        assert board.fields("state")[-1] == state


@pytest.mark.parametrize("bits", [100, 1_000])
def test_a_brown_out_that_damages_the_memory_starts_stopped(bits: int) -> None:
    """60 times flipped bits anywhere in the 2 KB, with an e-stop in force: none is lost, and the cause is 3."""
    luck = random.Random(bits)
    board = Emulated()
    states = set()
    for _ in range(60):
        board.board.reset(power_on=True)
        board.run(0.1)
        board.write("estop")
        board.run(0.02)
        for _ in range(bits):
            address = luck.randrange(RAM_BEGIN, RAM_END + 1)
            board.board.poke(address, board.board.peek(address) ^ (1 << luck.randrange(8)))
        board.board.reset()
        board.board.poke(MCUSR_AT, BROWN_OUT_FLAG)
        board.run(0.1)
        board.write("s 90 90")
        board.run(0.02)
        assert board.board.duty == (0, 0)
        board.hello(2000)
        board.run(0.25)
        states.add(tuple(board.fields("state")[-1]))
    assert states == {("1", "2", "1", "3")}


def test_the_command_r_restarts_by_software() -> None:
    """`r` says so, takes the duty off and comes back with the banner and cause 5, without the watchdog."""
    board = Emulated()
    board.hello()
    board.seal("s 90 90")
    board.run(0.05)
    board.forget()
    board.seal("r")
    board.run(0.3)
    assert board.lines.index("Reset Done") < board.lines.index("Initializing I2C devices...")
    assert "firmware\t1\t0\t1\t1\t15\t5" in board.lines
    assert board.board.duty == (0, 0)
