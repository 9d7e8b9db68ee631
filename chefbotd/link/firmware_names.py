"""The names of what our firmware says by numbers (docs/firmware_wire.md)."""

from collections.abc import Mapping

BOARDS = {1: "atmega328p", 2: "tm4c123", 3: "lm3s6965", 4: "host"}
CAPABILITIES = {1: "wheel_loop", 2: "ultrasonic", 4: "imu", 8: "battery", 16: "motor_current"}
RESET_CAUSES = {
    1: "power_on",
    2: "reset_pin",
    3: "brown_out",
    4: "watchdog",
    5: "command",
    6: "hung_main_loop",
}
STOPS = {1: "dead_man", 2: "estop", 4: "stall"}
LATCHED_STOPS = 2 | 4
REFUSALS = {
    1: "unknown word",
    2: "wrong number of fields",
    3: "a number is out of range",
    4: "the board is stopped",
    5: "the wheel loop is not set up",
    6: "wrong number of the e-stop",
    7: "unknown protocol",
}


def names(table: Mapping[int, str], flags: int) -> tuple[str, ...]:
    """The names of the bits that are set."""
    return tuple([name for flag, name in table.items() if flags & flag])
