"""What a cycle of the board costs, as a number of calls."""

import dis
from typing import Any

from benchmarks.calls import CallCounter, OpcodeCounter, count, count_opcodes, count_request, part_of

BOUND, FRAMES_BOUND, OPCODES_BOUND = 341, 228, 8_200
REQUEST_FRAMES_BOUND, REQUEST_OPCODES_BOUND = 95, 1_820
"""A little above what a cycle takes. Raise one only for something that is worth it."""


def test_a_cycle_calls_no_more_functions_than_it_did() -> None:
    """From the serial port's readiness to the telemetry and the motor command, with one client and the robot driving."""
    counted = count(cycles=12)
    assert sum(counted.values()) <= BOUND, counted
    assert {"parsing", "link", "port", "motion", "safety", "drive service", "telemetry"} <= set(counted)


def test_a_cycle_executes_no_more_opcodes_than_it_did() -> None:
    """Python's frames, and what the interpreter executes in them; a cold processor feels each."""
    frames, opcodes = count_opcodes(cycles=12)
    assert 100 < frames <= FRAMES_BOUND
    assert 1000 < opcodes <= OPCODES_BOUND


def test_a_drive_that_is_said_again_executes_no_more_opcodes_than_it_did() -> None:
    """From its bytes to the bytes of its answer; it was 4,700 when each was carried out as a new one."""
    frames, opcodes = count_request(cycles=12)
    assert 30 < frames <= REQUEST_FRAMES_BOUND
    assert 500 < opcodes <= REQUEST_OPCODES_BOUND


def test_each_opcode_counts_one() -> None:
    """A function and what it calls, by their disassembly; RESUME is not traced, and the counting's end is taken off."""
    made: dict[str, Any] = {}
    code = "def outer():\n    inner(2)\ndef inner(x):\n    return x\n"
    exec(compile(code, "/a/chefbotd/bus.py", "exec"), made)
    counter, nothing = OpcodeCounter(), OpcodeCounter()
    with counter.counting():
        made["outer"]()
    with nothing.counting():
        pass
    assert counter.by_part["bus"] == 2
    executed = [each.opname for name in ("outer", "inner") for each in dis.get_instructions(made[name])]
    assert counter.opcodes - nothing.opcodes == len(executed) - executed.count("RESUME")


def test_python_and_c_functions_count_one_each() -> None:
    """A function of the daemon's counts, and so does what it calls in C."""
    code = "def outer():\n    return abs(inner(-3))\ndef inner(x):\n    return x\n"
    made: dict[str, Any] = {}
    exec(compile(code, "/a/chefbotd/bus.py", "exec"), made)
    counter = CallCounter()
    with counter.counting():
        made["outer"]()
    assert counter.by_part["bus"] == 3
    assert counter.by_function["bus", "outer: abs"] == 1


def test_the_event_loop_is_no_part_of_the_daemon() -> None:
    """On uvloop it is not Python; the most specific part is the one that counts."""
    assert part_of("/lib/python3/asyncio/base_events.py", "call_soon") is None
    assert part_of("/site/chefbotd/clock.py", "time") is None
    assert part_of("/site/chefbotd/clock.py", "now_s") == "clock"
    assert part_of("/site/chefbotd/motion/odometry.py", "integrate") == "odometry"
    assert part_of("/site/chefbotd/motion/pid.py", "step") == "motion"
