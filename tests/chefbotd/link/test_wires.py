"""What is told of a wire by its name, and what a line must carry for a board that sends its encoders' edges."""

import pytest

from chefbotd.link.wires import Needs, needed_bytes_s, stop_line, variant_of, wires


def test_khan_at_full_speed_is_counted_by_hand():
    """5,240 edges/s are 263 a cycle, 88 characters: "q.0.65535." 10, 88, ".4294967295" 11, ".190" 4 times 3, and LF.

    That is 122 a wheel. The rest: "t.4294967295.0.05" 17, "s" and four of ".-1023.00" 37, "a.0.4095.00" 11,
    "b.4095.00" 9, and four LF: 78. So 20 cycles a second are 20 (4 * 122 + 78).
    """
    assert needed_bytes_s("khan_edges", [5240.0] * 4, analogue_inputs=1) == 20 * (4 * 122 + 78) == 11_320


def test_every_sensor_has_its_line():
    """Standing nearly still (one edge a cycle, "q.0.65535.).4294967295" 22 and LF): u is 6, i is 26, another a is 12."""
    bare = 20 * (4 * 23 + 66)
    rates = [1.0] * 4
    assert needed_bytes_s("khan_edges", rates) == bare
    assert needed_bytes_s("khan_edges", rates, analogue_inputs=2) == bare + 20 * 24
    assert needed_bytes_s("khan_edges", rates, ultrasonic=True, imu=True) == bare + 20 * (6 + 26)


@pytest.mark.parametrize(("edges_s", "line_bytes"), [(7680.0, 34 + 128), (7681.0, 34 + 128 + 23)])
def test_a_wheel_with_more_edges_than_a_line_holds_needs_another(edges_s: float, line_bytes: int):
    """384 edges a cycle fill 128 characters; the 385th is a line of 23 bytes."""
    alone = 20 * (3 * 23 + 66)
    assert needed_bytes_s("khan_edges", [edges_s, 1.0, 1.0, 1.0]) == alone + 20 * line_bytes


@pytest.mark.parametrize(
    ("needs", "names"),
    [
        (None, ["classic", "four_wheels", "khan", "khan_edges"]),
        (Needs.ULTRASONIC, ["classic", "four_wheels", "khan", "khan_edges"]),
        (Needs.INFRARED, ["khan", "khan_edges"]),
        (Needs.QUADRATURE, ["khan_edges"]),
    ],
)
def test_wires_are_told_by_what_they_tell(needs: Needs | None, names: list[str]):
    """Each as the table of docs/protocol.md has it."""
    assert wires(needs) == names


def test_a_stop_has_a_zero_for_every_wheel():
    """As ``docs/protocol.md`` spells it: two wheels, and KHAN's four."""
    assert stop_line("classic") == b"s 0 0\r"
    assert stop_line("khan") == b"s 0 0 0 0\r"
    assert variant_of("khan").wheels == 4
