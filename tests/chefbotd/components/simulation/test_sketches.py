"""The published sketches, each as it was measured."""

import math
from itertools import pairwise
from typing import Any

import pytest
from pydantic import ValidationError

from chefbotd.components.simulation.board import Launchpad
from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.parameters.sketches import PUBLISHED_SKETCHES, BoardParameters
from chefbotd.components.simulation.simulation import FirstLineCut, Simulation, build_launchpad
from chefbotd.core.record import replace
from firmware_protocol.codec import KHAN
from tests.budget import sample

BANNER = b"Initializing I2C devices...\r\n"
CYCLES = {"tiva": "teusib", "tiva_bare": "esb", "duemilanove": "teusi", "tiva_second": "tesb"}
RATES_HZ = {"tiva": 20, "tiva_bare": 290, "duemilanove": 50, "tiva_second": 200}


def board(sketch: str, **tables: Any) -> Launchpad:
    """A ChefBot whose board runs this sketch; tables as in the configuration."""
    tables["board"] = {"sketch": sketch, **tables.get("board", {})}
    return build_launchpad(Simulation(SimulationParameters.model_validate(tables)))


def kinds(launchpad: Launchpad, to_s: float) -> str:
    """The first letters of what it sends, in order."""
    return "".join(chr(line[0]) for _, line in launchpad.advance(to_s))


@pytest.mark.parametrize("sketch", sample(PUBLISHED_SKETCHES))
def test_a_cycle_has_its_lines_at_its_rate(sketch: str):
    """The lines of a cycle in their order, as often as measured, within 5 %; ``i`` may be missing."""
    launchpad = board(sketch)
    kinds(launchpad, 1.0)
    sent = kinds(launchpad, 11.0)
    bare = sent[sent.index("e") :].replace("i", "")
    cycle = CYCLES[sketch].replace("i", "").replace("t", "")
    assert bare.replace("t", "").startswith(cycle * (RATES_HZ[sketch] * 9))
    assert sent.count("e") == pytest.approx(10 * RATES_HZ[sketch], rel=0.05)
    assert ("t" in sent, "i" in sent) == ("t" in CYCLES[sketch], "i" in CYCLES[sketch])


@pytest.mark.parametrize("sketch", PUBLISHED_SKETCHES)
def test_only_those_with_an_imu_have_a_banner(sketch: str):
    """What B and D send first is a cycle."""
    sent = [line for _, line in board(sketch).advance(1.0)]
    assert (BANNER in sent) == ("i" in CYCLES[sketch])


@pytest.mark.slow
def test_up_to_a_fifth_of_the_quaternions_is_missing():
    """A leaves 19 % out: of 1200 cycles 228, within 4 sigma (54)."""
    sent = kinds(board("tiva"), 60.2)
    assert abs(sent.count("e") - sent.count("i") - 0.19 * sent.count("e")) < 54


def quaternion_heading_rad(line: bytes) -> float:
    """The heading in an ``i`` line."""
    z, w = (float(field) for field in line.split(b"\t")[3:5])
    return 2 * math.atan2(z, w)


@pytest.mark.slow
def test_a_quaternion_is_late_once_the_fifo_has_backed_up():
    """After an echo that was missing for 1 s the oldest of 20 samples comes first: turning at 1 rad/s, 1 rad late."""
    launchpad = board("tiva", ultrasonic={"lost_echo_share": 0.05}, imu={"heading_noise_rad": 0.0})
    launchpad.receive(b"s -60 60\r", 0.5)
    behind_rad = []
    for left_s, line in launchpad.advance(20.0):
        if line.startswith(b"i") and left_s > 3.0:
            behind_rad.append((left_s, quaternion_heading_rad(line)))
    turned = board("tiva", ultrasonic={"lost_echo_share": 0.05}, imu={"heading_noise_rad": 0.0})
    turned.receive(b"s -60 60\r", 0.5)
    late_rad = [
        abs(math.remainder(turned.truth(at_s, 0.0).world_from_base.heading_rad - heading_rad, math.tau))
        for at_s, heading_rad in behind_rad
    ]
    rate_rad_s = abs(turned.truth(20.0, 0.0).twist.angular_rad_s)
    assert min(late_rad) < 0.05 * rate_rad_s + 0.03
    assert 0.8 * rate_rad_s < max(late_rad) < 1.1 * rate_rad_s


@pytest.mark.parametrize("sketch", ["tiva", "duemilanove"])
def test_a_command_is_in_force_after_the_echo(sketch: str):
    """It comes while the first echo is awaited, is read a second after boot, and holds after the next one's second."""
    launchpad = board(sketch, ultrasonic={"lost_echo_share": 1})
    launchpad.receive(b"s 50 -30\r", 0.9)
    launchpad.advance(2.15)
    assert launchpad.sketch.duty == (0, 0)
    launchpad.advance(2.4)
    assert launchpad.sketch.duty == (50, -30)


@pytest.mark.parametrize("sketch", ["tiva", "tiva_bare", "tiva_second"])
def test_a_stop_that_comes_with_a_reset_is_in_force_only_after_it(sketch: str):
    """``s 0 0`` and ``r`` in one batch: `Reset Done` at once, and the wheels turn for the second that it waits."""
    launchpad = board(sketch)
    launchpad.receive(b"s 60 40\r", 1.0)
    launchpad.advance(3.0)
    launchpad.receive(b"s 0 0\rr\rs 0 0\r", 3.0)
    sent = [line for _, line in launchpad.advance(3.2)]
    assert sent[-1] == b"Reset Done\r\n"
    assert launchpad.truth(3.9, 0.0).twist.linear_m_s > 0.02
    counts = [int(line.split(b"\t")[1]) for _, line in launchpad.advance(6.0) if line[:1] == b"e"]
    assert abs(counts[0]) < 400
    assert launchpad.sketch.duty == (0, 0)


def test_the_duemilanove_says_that_it_resets_and_does_not():
    """C answers `Reset Done`, waits, and goes on with its counters and with what came in the meantime."""
    launchpad = board("duemilanove")
    launchpad.receive(b"s 60 40\r", 1.0)
    before = [line for _, line in launchpad.advance(3.0) if line[:1] == b"e"][-1]
    launchpad.receive(b"r\rs 20 30\r", 3.0)
    sent = [line for _, line in launchpad.advance(6.0)]
    assert b"Reset Done\r\n" in sent
    assert BANNER not in sent
    counted = next(int(line.split(b"\t")[1]) for line in sent if line[:1] == b"e")
    assert counted >= int(before.split(b"\t")[1])
    assert launchpad.sketch.duty == (20, 30)


def test_what_an_overflown_ring_leaves_is_obeyed():
    """63 bytes of seven commands stay while C waits for an echo: the piece that is left joins the next command."""
    launchpad = board("duemilanove", ultrasonic={"lost_echo_share": 1})
    launchpad.advance(1.0)
    launchpad.receive(b"s 66 41\r" * 9, 1.0)  # 8 bytes each: the eighth lacks its CR
    assert launchpad.uart.received_dropped == 9
    launchpad.advance(2.4)
    launchpad.receive(b"37\r", 2.5)
    launchpad.advance(4.6)
    assert launchpad.sketch.duty == (66, 4137)


def test_what_is_in_force_is_echoed_however_large():
    """A number that two commands made together stands in the echo as it is."""
    launchpad = board("tiva")
    launchpad.receive(b"s -250146 41\r", 1.0)
    assert b"s\t-250146.00\t41.00\n" in [line for _, line in launchpad.advance(2.0)]


def test_256_is_off_on_an_avr_and_full_on_a_tiva():
    """The low eight bits of 256 are 0: the wheels stand; a Tiva's run."""
    speeds = []
    for sketch in ("duemilanove", "tiva_second"):
        launchpad = board(sketch)
        launchpad.receive(b"s 256 256\r", 1.0)
        launchpad.advance(3.0)
        speeds.append(launchpad.truth(3.0, 0.0).twist.linear_m_s)
    assert speeds[0] == 0.0
    assert speeds[1] > 0.3


def test_the_duemilanoves_converter_hands_over_every_16_ms():
    """Every line of C comes at a whole multiple of 16 ms, several at once."""
    times = [left_s for left_s, _ in board("duemilanove").advance(2.0)]
    assert [left_s / 0.016 for left_s in times] == pytest.approx([round(left_s / 0.016) for left_s in times])
    assert any(one == other for one, other in pairwise(times))


def test_who_opens_the_port_hears_the_end_of_a_line_first():
    """The second half of the first line, then whole ones, anew for each host; what nobody hears is not cut."""
    heard: list[bytes] = []
    host: list[object | None] = [None]
    cut = FirstLineCut(heard.append, lambda: host[0])
    cut(b"e\t1\t2\n")
    host[0] = "first"
    cut(b"e\t12\t34\ns\t0.00\n")
    cut(b"e\t5\t6\n")
    host[0] = "second"
    cut(b"e\t7\t8\n")
    assert heard == [b"e\t1\t2\n", b"\t34\ns\t0.00\n", b"e\t5\t6\n", b"\t8\n"]


def test_what_is_given_goes_before_what_the_sketch_has():
    """A key of the configuration replaces the sketch's own value, and no other."""
    given = BoardParameters.model_validate({"sketch": "duemilanove", "cycle_s": 0.03})
    assert (given.cycle_s, given.receive_buffer_bytes, given.lines) == (0.03, 63, "teusi")


def test_a_sketch_that_is_none_is_refused():
    """The names that there are are told."""
    with pytest.raises(ValidationError, match="'tiva', 'tiva_bare', 'duemilanove', 'tiva_second', 'khan'"):
        BoardParameters.model_validate({"sketch": "uno"})


def test_a_published_sketch_is_for_the_classic_wire():
    """KHAN's board runs another: the refusal says which key to set."""
    assumed = SimulationParameters.model_validate({"board": {"sketch": "khan"}})
    khan = Simulation(assumed, variant=KHAN, chassis=replace(PUBLISHED, wheels=PUBLISHED.wheels * 2))
    tiva = SimulationParameters.model_validate({"board": {"sketch": "tiva"}})
    with pytest.raises(
        ValueError, match=r"'tiva' speaks the wire 'classic', the robot 'khan': set sim\.board\.sketch"
    ):
        replace(khan, parameters=tiva)
