"""A simulated board that runs our own firmware: the robot's wheels and sensors, and the time of each line."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.components.simulation.board import SimulatedBoard
from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.simulation import Simulation, build_launchpad
from chefbotd.core.record import replace
from firmware_protocol.checked import unseal
from tests.firmware.host import seal

BYTE_S = 1 / 11_520


def board(robot: Simulation | None = None, **keys: Any) -> SimulatedBoard:
    """Our firmware on ChefBot's board; ``keys`` are those of ``[sim.board]``."""
    parameters = SimulationParameters.model_validate({"board": {"sketch": "chefbot", **keys}})
    return build_launchpad(replace(robot or Simulation(), parameters=parameters), 1)


def sealed(body: str, sequence: int) -> bytes:
    """A sealed line with its end."""
    return f"{seal(f'{body} {sequence}')}\r".encode()


def lines(launchpad: SimulatedBoard, to_s: float) -> list[bytes]:
    """What the board sends until then."""
    return [line for _, line in launchpad.advance(to_s)]


def fields(sent: Iterable[bytes], kind: bytes) -> list[list[bytes]]:
    """The fields of the lines of one kind, sealed or not, without sequence number."""
    bodies = [(unseal(line.strip(), b"\t") or (line.strip(), 0))[0] for line in sent]
    return [body.split(b"\t")[1:] for body in bodies if body.split(b"\t")[0] == kind]


def test_it_boots_and_says_what_it_is() -> None:
    """Nothing before 0.2 s; then banner and name, each when its last byte has left, and 20 ms after them a cycle."""
    launchpad = board()
    assert launchpad.next_event_s() == 0.2
    assert launchpad.advance(0.2) == []
    (banner_s, banner), (name_s, name), (first_s, first) = launchpad.advance(0.223)[:3]
    assert banner.startswith(b"Initializing I2C devices...\r\n")
    assert banner.endswith(b"MPU6050 connection successful\r\n")
    assert name == b"firmware\t1\t0\t1\t4\t15\t1\n"
    assert banner_s == pytest.approx(0.2 + len(banner) * BYTE_S, abs=2e-6)
    assert name_s == pytest.approx(banner_s + len(name) * BYTE_S, abs=2e-6)
    assert first == b"t\t220000\t0.02\n"
    assert first_s == pytest.approx(0.22 + len(first) * BYTE_S, abs=2e-6)


@given(st.lists(st.floats(0.0001, 0.1), min_size=20, max_size=60))
def test_when_and_how_often_it_is_advanced_changes_nothing(steps_s: list[float]) -> None:
    """Two seconds with two duties and a wheel that turns back: the same lines at the same times, whatever the steps."""
    commands = [
        (0.5, sealed("hello 1 500", 0)),
        (0.7003, sealed("s 90 -70", 1)),
        (1.1, sealed("s -120 35", 2)),
    ]

    def run(stops_s: Sequence[float]) -> list[tuple[float, bytes]]:
        launchpad, sent, begun_s = board(), [], 0.0
        for at_s, data in [*commands, (2.0, b"")]:
            for stop_s in stops_s:
                if begun_s < stop_s < at_s:
                    sent += launchpad.advance(stop_s)
            begun_s = at_s
            if data:
                launchpad.receive(data, at_s)
        return sent + launchpad.advance(2.0)

    at_s, stops_s = 0.0, []
    for step_s in steps_s:
        at_s += step_s
        stops_s.append(at_s)
    assert run(stops_s) == run([])


@pytest.mark.parametrize("boot_s", [0.0, 0.1, 0.2, 0.3333333, 0.7])
def test_what_is_due_is_done_when_it_is_due(boot_s: float) -> None:
    """Advanced to each time that it names, a second and through a restart: the next one is always later."""
    launchpad = board(boot_s=boot_s)
    launchpad.receive(b"r\r", boot_s + 0.07)
    at_s, sent = launchpad.next_event_s(), 0
    while at_s < 2 * boot_s + 1.0:
        sent += len(launchpad.advance(at_s))
        assert launchpad.next_event_s() > at_s
        at_s = launchpad.next_event_s()
    assert sent > 200


@pytest.mark.parametrize(
    ("motor_sign", "encoder_sign", "forward"), [(1, 1, 1), (-1, 1, -1), (1, -1, -1), (-1, -1, 1)]
)
def test_the_left_encoder_counts_what_its_wheel_turns(
    motor_sign: int, encoder_sign: int, forward: int
) -> None:
    """Duty 120 to the left, none to the right: the counts are the wheel's true turn, wired either way."""
    left, right = PUBLISHED.wheels
    odd = replace(left, motor_sign=motor_sign, encoder_sign=encoder_sign)
    launchpad = board(Simulation(chassis=replace(PUBLISHED, wheels=(odd, right))))
    launchpad.receive(b"s 120 0\r", 0.3)
    launchpad.advance(0.98)
    left_rad, right_rad = launchpad.robot.wheel_angles_rad
    counted = fields(lines(launchpad, 0.99), b"e")[-1]
    per_rad = PUBLISHED.counts_per_turn / math.tau
    assert int(counted[0]) * forward > 100
    assert int(counted[0]) == math.floor(left_rad * encoder_sign * per_rad)
    assert int(counted[1]) == math.floor(right_rad * per_rad)


def test_the_dead_man_stops_the_motors_at_its_millisecond() -> None:
    """A duty at 0.6004 s with a dead-man of 250 ms is in force at 0.8503 s, and over from 0.851 s on."""
    launchpad = board()
    launchpad.receive(sealed("hello 1 250", 0), 0.5)
    launchpad.receive(sealed("s 80 -60", 1), 0.6004)
    assert launchpad.duty_at(0.8503) == (80, -60)
    assert launchpad.duty_since_s == pytest.approx(0.6004)
    assert launchpad.duty_at(0.8511) == (0, 0)
    assert launchpad.duty_since_s == pytest.approx(0.851)


def test_a_cycle_begins_with_its_millisecond() -> None:
    """The mode changes at 0.5004 s: its cycles are at whole milliseconds all the same."""
    launchpad = board()
    lines(launchpad, 0.5)
    launchpad.receive(sealed("hello 1 250", 0), 0.5004)
    stamps_us = [int(stamp) for stamp, _ in fields(lines(launchpad, 0.6), b"t")]
    assert stamps_us == list(
        range(500_000, 600_000, 10_000)
    )  # the first one is the classic cycle on the wire


def test_an_estop_that_comes_while_it_restarts_is_obeyed() -> None:
    """`r` at 0.5 s, `estop` at 0.6 s, when the program does not run: it starts stopped, by command, and stays so."""
    launchpad = board()
    launchpad.receive(b"r\r", 0.5)
    assert lines(launchpad, 0.599)[-1] == b"Reset Done\r\n"
    launchpad.receive(b"estop\r", 0.6)
    launchpad.receive(b"s 50 60\r", 0.9)
    assert launchpad.duty_at(1.0) == (0, 0)
    assert fields(lines(launchpad, 1.0), b"firmware") == [[b"1", b"0", b"1", b"4", b"15", b"5"]]
    launchpad.receive(sealed("arm 1", 0), 1.0)
    launchpad.receive(b"s 50 60\r", 1.1)
    assert launchpad.duty_at(1.1) == (50, 60)


def test_a_restart_counts_from_zero_and_coasts_meanwhile() -> None:
    """A board that drove restarts by `r`: no duty until it runs again, and its encoders begin with 0."""
    launchpad = board()
    launchpad.receive(b"s 150 150\r", 0.3)
    launchpad.receive(b"r\r", 1.0)
    assert launchpad.duty_at(1.0) == (0, 0)
    launchpad.receive(b"s 150 150\r", 1.2)
    assert int(fields(lines(launchpad, 1.0), b"e")[-1][0]) > 300
    again = lines(launchpad, 1.4)
    assert launchpad.duty_at(1.4) == (0, 0)
    assert [abs(int(count)) < 30 for count in fields(again, b"e")[-1]] == [True, True]


def test_a_wire_that_is_slower_than_its_cycles_leaves_lines_out_and_cuts_none() -> None:
    """At 9600 baud: the lines are whole, and one after the other."""
    launchpad = board(line_rate_bytes_s=960.0)
    launchpad.receive(sealed("hello 1 2000", 0), 0.3)
    launchpad.receive(sealed("hello 1 2000", 1), 2.0)
    launchpad.advance(2.0)
    sent = launchpad.advance(4.0)
    for (before_s, _), (left_s, line) in pairwise(sent):
        assert left_s - before_s >= len(line) / 960 - 2e-6
    assert all(unseal(line.strip(), b"\t") for _, line in sent)
    assert 50 < len(sent) < 2.0 * 960 / 10


def test_the_ultrasonic_sensor_tells_how_far_the_wall_is() -> None:
    """The centimetres of the room's wall ahead, 20 times a second; none while its echoes are lost."""
    launchpad = board()
    launchpad.receive(sealed("hello 1 2000", 0), 0.3)
    lines(launchpad, 0.4)
    distances = [int(cm) for cm, _ in fields(lines(launchpad, 1.4), b"u")]
    assert len(distances) == 20
    assert max(distances) - min(distances) <= 4
    assert min(distances) > 100
    launchpad.sketch.loses_echoes = True
    assert [cm for cm, _ in fields(lines(launchpad, 1.9), b"u")][3:] == [b"0"] * 6


def test_a_robot_without_an_imu_says_so() -> None:
    """The banner has it that none answers, and no line is about one."""
    sent = lines(board(Simulation(has_imu=False)), 2.0)
    assert sent[0].endswith(b"MPU6050 connection failed\r\n")
    assert fields(sent, b"i") == []
    assert len(fields(sent, b"e")) == 89  # from 0.22 to 1.98 s


def test_what_the_receive_buffer_does_not_hold_is_lost_and_counted() -> None:
    """Of 200 bytes at once 128 come in: the stop at their end is lost, the next one is not."""
    launchpad = board()
    launchpad.receive(b"s 40 40\r", 0.3)
    launchpad.receive(b"x" * 193 + b"s 0 0\r", 0.4)
    assert launchpad.uart.received_dropped == 71
    assert launchpad.duty_at(0.5) == (40, 40)
    launchpad.receive(b"\rs 0 0\r", 0.5)
    assert launchpad.duty_at(0.5) == (0, 0)


def test_its_clock_wraps_while_it_drives() -> None:
    """Powered on 0.3 s before the wrap at 2^32 us: cycles and dead-man go on as before."""
    launchpad = board(boot_micros=(1 << 32) - 300_000)
    launchpad.receive(sealed("hello 1 250", 0), 0.25)
    launchpad.receive(sealed("s 80 80", 1), 0.29)
    stamps_us = [int(stamp) for stamp, _ in fields(lines(launchpad, 0.39), b"t")]
    assert stamps_us[-2:] == [70_000, 80_000]
    assert launchpad.duty_at(0.539) == (80, 80)
    assert launchpad.duty_at(0.5405) == (0, 0)
