"""The simulated board, heard over its wire: what it sends, when, and what it makes of commands."""

import hashlib
import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.board import Launchpad
from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.parameters.sketches import BoardParameters, SketchName
from chefbotd.components.simulation.simulation import Simulation, build_launchpad
from chefbotd.core.record import replace
from firmware_protocol.codec import FOUR_WHEELS, Variant
from tests.budget import examples, sample

PLAIN = SimulationParameters(board=BoardParameters(sketch=SketchName.KHAN))
CHEFBOT = Simulation(PLAIN)
BANNER = [
    b"Initializing I2C devices...\r\n",
    b"Testing device connections...\r\n",
    b"MPU6050 connection successful\r\n",
]


def board(seed: int = 1, robot: Simulation = CHEFBOT, **tables: Any) -> Launchpad:
    """A robot's board; tables as in the configuration. It runs the plainest program: 50 Hz, and no IMU to wait for."""
    tables["board"] = {"sketch": "khan", "pwm_full_scale": 255, **tables.get("board", {})}
    return build_launchpad(replace(robot, parameters=SimulationParameters.model_validate(tables)), seed)


def lines(launchpad: Launchpad, to_s: float) -> list[bytes]:
    """What the board sends until ``to_s``, line by line."""
    return [line for _, line in launchpad.advance(to_s)]


def fields(sent: list[bytes], kind: bytes) -> list[list[float]]:
    """The numbers of the lines of one kind."""
    return [[float(f) for f in line.split(b"\t")[1:]] for line in sent if line.split(b"\t")[0] == kind]


def test_a_board_boots_with_its_banner() -> None:
    """Nothing but the banner comes before the first cycle."""
    launchpad = board(board={"boot_s": 0.3})
    assert launchpad.advance(0.3) == []
    assert lines(launchpad, 1.0)[:3] == BANNER


def test_a_board_boots_with_the_banner_of_its_variant() -> None:
    """Another robot's board prints what its table says, and nothing of ChefBot's."""
    sled = Variant("sled", banner=("Sled 2.1", "ready"))
    sent = lines(board(robot=Simulation(PLAIN, variant=sled)), 1.0)
    assert sent[:2] == [b"Sled 2.1\r\n", b"ready\r\n"]
    assert not set(sent) & set(BANNER)


def test_a_wheel_that_is_wired_backwards_turns_and_counts_so() -> None:
    """Told the same duty: a motor the wrong way round turns its wheel back, and an encoder so tells the opposite."""
    left, right = PUBLISHED.wheels
    wired = {}
    for motor_sign, encoder_sign in [(1, 1), (-1, 1), (1, -1), (-1, -1)]:
        odd = replace(left, motor_sign=motor_sign, encoder_sign=encoder_sign)
        launchpad = board(robot=Simulation(chassis=replace(PUBLISHED, wheels=(odd, right))))
        launchpad.receive(b"s 500 500\r", 1.0)
        counted = fields(lines(launchpad, 1.5), b"e")[-1]
        turned_rad_s = launchpad.truth(1.5, 0.0).twist.angular_rad_s
        wired[motor_sign, encoder_sign] = (counted[0] > 0, counted[1] > 0, abs(turned_rad_s) > 0.1)
        assert fields(lines(launchpad, 2.0), b"s")[-1] == [500.0, 500.0]
    assert wired == {
        (1, 1): (True, True, False),
        (-1, 1): (False, True, True),
        (1, -1): (False, True, False),
        (-1, -1): (True, True, True),
    }


def test_a_cycle_has_the_sketchs_order() -> None:
    """Every cycle sends t e u s i b, in this order, each line ended by LF."""
    sent = lines(board(), 2.0)[3:]
    kinds = b"".join(line[:1] for line in sent)
    assert kinds.startswith(b"teusib" * 50)
    assert all(line.endswith(b"\n") and line.count(b"\n") == 1 for line in sent)


def test_cycles_take_their_least_time() -> None:
    """At ``cycle_s`` 0.05 each ``t`` is 50,000 µs after the last, and says 0.05 s."""
    times = fields(lines(board(board={"cycle_s": 0.05}), 3.0), b"t")
    steps = [after[0] - before[0] for before, after in pairwise(times)]
    assert steps == pytest.approx([50_000] * len(steps), abs=1)
    assert {cycle_s for _, cycle_s in times[1:]} == {0.05}


def test_lines_leave_at_the_line_rate() -> None:
    """No line leaves sooner after the one before than its bytes take at 11,520 bytes/s."""
    sent = board(board={"cycle_s": 0.001, "blocking_ultrasonic": False}).advance(2.0)
    gaps = [(after[0] - before[0], len(after[1])) for before, after in pairwise(sent)]
    assert min(gap_s - size / 11_520 for gap_s, size in gaps) >= -1e-9
    spent_s = sent[-1][0] - sent[0][0]
    assert sum(size for _, size in gaps) / spent_s == pytest.approx(11_520)


def test_an_echo_blocks_the_sketch_for_its_flight() -> None:
    """The cupboard's corner 2.55 m off of the sensor answers after 2 * 2.55 / 343 = 14.9 ms: no cycle is shorter."""
    launchpad = board(board={"cycle_s": 0.001}, ultrasonic={"noise_m": 0})
    times = fields(lines(launchpad, 2.0), b"t")
    step_s = (times[-1][0] - times[-2][0]) / 1e6
    assert 0.0149 < step_s < 0.023
    free = board(board={"cycle_s": 0.001, "blocking_ultrasonic": False}, ultrasonic={"noise_m": 0})
    times = fields(lines(free, 2.0), b"t")
    assert (times[-1][0] - times[-2][0]) / 1e6 < step_s


def test_distance_is_in_whole_centimetres_rounded_down() -> None:
    """The wall at 3.1 m is 2.95 m ahead: 17201 µs of echo, of which the sketch makes 17201 // 29 // 2 = 296."""
    launchpad = board(ultrasonic={"noise_m": 0, "rays": 1})
    assert fields(lines(launchpad, 1.0), b"u")[0] == [296.0]


def test_a_missing_echo_stops_everything_for_the_timeout() -> None:
    """Without an echo ``u`` is 0 and comes ``echo_timeout_s`` after ``e``; nothing comes in between."""
    launchpad = board(ultrasonic={"lost_echo_share": 1}, board={"echo_timeout_s": 0.8})
    sent = launchpad.advance(2.0)
    at = [line[:1] for _, line in sent].index(b"u")
    assert sent[at][1] == b"u\t0\n"
    assert sent[at][0] - sent[at - 1][0] == pytest.approx(0.8, abs=0.01)


def test_a_short_timeout_shortens_the_range() -> None:
    """A sketch that gives up after 5 ms hears nothing beyond 0.86 m."""
    assert fields(lines(board(board={"echo_timeout_s": 0.005}), 1.0), b"u")[0] == [0.0]


def test_commands_drive_and_are_echoed() -> None:
    """``s 300 -200`` is echoed by the next ``s`` line and turns the wheels that way."""
    launchpad = board()
    launchpad.advance(1.0)
    launchpad.receive(b"s 300 -200\r", 1.0)
    sent = lines(launchpad, 2.0)
    assert fields(sent, b"s")[-1] == [300.0, -200.0]
    left, right = fields(sent, b"e")[-1]
    assert left > 100
    assert right < -50
    assert launchpad.sketch.duty == (300, -200)


@pytest.mark.slow
def test_there_is_no_watchdog() -> None:
    """A minute after the last command the motors still obey it."""
    launchpad = board()
    launchpad.receive(b"s 200 -200\r", 1.0)
    assert launchpad.truth(61.0, 0.0).twist.angular_rad_s < -0.3


def test_encoder_counts_are_those_of_the_true_motion() -> None:
    """4200 counts a turn of 0.2827 m: the counts say how far the robot has really gone."""
    launchpad = board()
    launchpad.receive(b"s 500 500\r", 1.0)
    sent = lines(launchpad, 4.0)
    launchpad.receive(b"s 0 0\r", 4.0)
    sent = lines(launchpad, 6.0)
    left = fields(sent, b"e")[-1][0]
    assert launchpad.truth(6.0, 0.0).world_from_base.x_m == pytest.approx(
        left / 4200 * math.pi * 0.09, abs=1e-4
    )


def test_malformed_and_overlong_commands_are_ignored() -> None:
    """A kind that is none, 70 bytes (too long after 64) and their end: counted; the next command counts again."""
    launchpad = board()
    launchpad.receive(b"x 1\r" + b"s" * 70 + b"\r", 1.0)
    launchpad.advance(1.1)
    assert launchpad.sketch.duty == (0, 0)
    assert launchpad.sketch.commands.ignored == 3
    launchpad.receive(b"\ns 7 8\r\n", 1.1)
    launchpad.advance(1.2)
    assert launchpad.sketch.duty == (7, 8)


def test_a_flood_of_commands_overflows_the_receive_buffer() -> None:
    """What arrives while the sketch stands still is lost beyond the buffer, and counted."""
    launchpad = board(ultrasonic={"lost_echo_share": 1}, board={"receive_buffer_bytes": 100})
    launchpad.receive(b"s 1 1\r" * 30, 0.5)
    assert launchpad.uart.received_dropped == 80


def test_reset_starts_over() -> None:
    """``r`` is answered, the last command holds for a second, then everything begins anew at 0."""
    launchpad = board()
    launchpad.receive(b"s 300 300\r", 1.0)
    launchpad.advance(3.0)
    launchpad.receive(b"r\rs 400 400\r", 3.0)
    sent = lines(launchpad, 3.5)
    assert sent[-1] == b"Reset Done\r\n"
    assert launchpad.truth(3.9, 0.0).twist.linear_m_s > 0.05
    assert lines(launchpad, 3.9) == []
    sent = lines(launchpad, 6.0)
    assert sent[:3] == BANNER
    assert fields(sent, b"t")[0][0] < 300_000
    assert fields(sent, b"s")[0] == [0.0, 0.0]
    assert abs(fields(sent, b"e")[0][0]) < 400
    assert launchpad.truth(6.0, 0.0).twist.linear_m_s == 0.0


def test_commands_during_the_boot_are_lost() -> None:
    """What arrives before the sketch listens is not obeyed later, nor glued to the next command."""
    launchpad = board(board={"boot_s": 0.5})
    launchpad.receive(b"s 100 100\rs 9", 0.2)
    launchpad.advance(1.0)
    assert launchpad.sketch.duty == (0, 0)
    launchpad.receive(b"s 5 5\r", 1.0)
    launchpad.advance(1.1)
    assert launchpad.sketch.duty == (5, 5)


def test_micros_wrap_at_32_bits() -> None:
    """Booted 1 s short of 2^32 µs, the counter starts again at 0 a second later."""
    micros = [t[0] for t in fields(lines(board(board={"boot_micros": 2**32 - 1_000_000}), 2.0), b"t")]
    wrapped = next(i for i, value in enumerate(micros) if value < 2**31)
    assert micros[wrapped - 1] > 2**32 - 30_000
    assert micros[wrapped] < 30_000


def test_counts_wrap_at_32_bits() -> None:
    """With 10^9 counts a turn a robot driving ahead passes 2^31 within three turns and goes on from -2^31."""
    launchpad = board(robot=Simulation(chassis=replace(PUBLISHED, counts_per_turn=1e9)))
    launchpad.receive(b"s 1000 1000\r", 0.5)
    counts = [e[0] for e in fields(lines(launchpad, 5.0), b"e")]
    wrapped = next(i for i, count in enumerate(counts) if count < 0)
    assert counts[wrapped - 1] > 2**31 - 5e7
    assert counts[wrapped] < -(2**31) + 5e7


def test_the_imu_misses_packets_as_often_as_asked() -> None:
    """With half of the packets missing, about half of 500 cycles have no ``i`` (4 sigma: 45)."""
    sent = lines(board(board={"missing_imu_share": 0.5}), 10.3)
    cycles, packets = len(fields(sent, b"t")), len(fields(sent, b"i"))
    assert abs(packets - cycles / 2) < 45


def test_the_raw_imu_variant_sends_six_counts() -> None:
    """A raw line has six integers, gravity in the third, and a CR LF LF end."""
    sent = lines(board(board={"raw_imu": True}), 1.0)
    raw = next(line for line in sent if line.startswith(b"i"))
    assert raw.endswith(b"\r\n\n")
    assert int(raw.split(b"\t")[3]) == pytest.approx(16_384, abs=400)
    assert len(raw.split(b"\t")) == 7


def test_the_arduino_variant_has_no_battery_line() -> None:
    """Without ``b`` among its ``lines`` a cycle is t e u s i."""
    kinds = b"".join(line[:1] for line in lines(board(board={"lines": "teusi"}), 1.0)[3:])
    assert kinds.startswith(b"teusi" * 20)


def test_the_battery_line_is_the_adc_reading() -> None:
    """12.73 V, less 0.05 ohm * 2 A, over a divider of 4 and 3.3 V: 3918 counts."""
    sent = lines(board(battery={"adc_noise_counts": 0}), 1.0)
    assert fields(sent, b"b")[0] == [3918.0]


def test_four_wheels_speak_their_own_variant() -> None:
    """Two wheels a side make four counts and four duties."""
    four = replace(PUBLISHED, wheels=PUBLISHED.wheels * 2)
    launchpad = board(robot=Simulation(PLAIN, variant=FOUR_WHEELS, chassis=four))
    launchpad.receive(b"s 100 200 300 400\r", 1.0)
    sent = lines(launchpad, 1.5)
    assert len(fields(sent, b"e")[-1]) == 4
    assert fields(sent, b"s")[-1] == [100.0, 200.0, 300.0, 400.0]


def test_next_event_is_when_to_come_back() -> None:
    """Advancing to ``next_event_s`` again and again gives the same lines as one long advance."""
    eager, lazy = board(), board()
    sent = []
    while (due_s := eager.next_event_s()) <= 2.0:
        sent += eager.advance(due_s)
    assert sent == lazy.advance(2.0)


@pytest.mark.slow
@settings(max_examples=examples(15), deadline=None)
@given(times=st.lists(st.floats(0, 2), max_size=8))
def test_how_often_the_board_is_asked_makes_no_difference(times: list[float]) -> None:
    """Any schedule of advances and looks at the truth yields the same lines at the same times."""
    asked, left_alone = board(), board()
    for launchpad in (asked, left_alone):
        launchpad.receive(b"s 400 -100\r", 0.0)
    sent = []
    for to_s in sorted(times):
        sent += asked.advance(to_s)
        asked.truth(to_s, 0.0)
    sent += asked.advance(2.0)
    assert sent == left_alone.advance(2.0)


def driven_about(seed: int, seconds: int) -> tuple[str, Any]:
    """The hash of the bytes from a board that is driven about, and where the robot ends."""
    launchpad, digest = board(seed, step_s=0.02, board={"cycle_s": 0.1}), hashlib.sha256()
    for second in range(seconds):
        launchpad.receive(
            (b"s 500 500\r", b"s -300 300\r", b"s -500 -500\r", b"s 0 0\r")[second % 4], float(second)
        )
        for left_s, line in launchpad.advance(second + 1.0):
            digest.update(f"{left_s!r}".encode() + line)
    return digest.hexdigest(), launchpad.truth(float(seconds), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", sample([60, 600]))
def test_same_seed_same_bytes(seconds: int) -> None:
    """Two drives with one seed, of a minute or ten, are identical to the byte and the instant."""
    assert driven_about(3, seconds) == driven_about(3, seconds)


def test_another_seed_sends_other_bytes() -> None:
    """Chance comes from the seed: a second of another seed's noise differs."""
    assert lines(board(1), 1.0) != lines(board(2), 1.0)
