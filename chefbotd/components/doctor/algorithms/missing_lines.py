"""Says what a robot does not know, or does not notice, where its board leaves out kinds of lines."""

from collections.abc import Sequence

from chefbotd.components.doctor.algorithms.finding import Finding, ok, skip_check, warning
from chefbotd.components.doctor.algorithms.lines import NAMES, LinesHeard

CHECK = "missing_lines"

COSTS = {
    "t": (
        "when a reading was taken is only guessed from when it came, so speeds are less exact, a jump or a standstill "
        "of an encoder may be the guess, and a restart shows only by its text or its counters"
    ),
    "s": (
        "which command the board obeys is not known: motors that were left on, a lost command, and a board that no "
        "longer obeys are not noticed before the wheels show it"
    ),
    "i": "the heading comes from the wheels alone, and one that slips turns it unnoticed",
    "b": "an empty battery is not noticed",
}
"""What each kind is for; that of ``u`` depends on the other sensors."""

ADVICE = (
    "before you suspect an encoder or its cable, have the board's program print them as docs/protocol.md says, or put "
    "our own firmware on the board"
)


def check_missing(
    heard: LinesHeard, other_guards: Sequence[str] = (), *, silent_is_obstacle: bool = False
) -> Finding:
    """What each kind of line costs that does not come.

    ``other_guards`` are the sensors that also stop the robot before obstacles; ``silent_is_obstacle``: a configured
    ultrasonic sensor that says nothing stops it too.
    """
    if not heard.is_board:
        return skip_check(CHECK, "nothing was received from a board")
    missing = [kind for kind in "tsuib" if not heard.sends(kind)]
    if not missing:
        return ok(CHECK, "no kind is missing: time, duty echo, ultrasonic, IMU and battery come")
    costs = {**COSTS, "u": _ahead(other_guards, silent_is_obstacle=silent_is_obstacle)}
    text = "; ".join(f"no {kind!r} lines ({NAMES[kind]}): {costs[kind]}" for kind in missing)
    if "t" in missing or "s" in missing:
        return warning(CHECK, text, ADVICE)
    if "u" in missing and not other_guards:
        return warning(CHECK, text, "stay beside the robot, or give it an ultrasonic sensor or a lidar")
    return ok(CHECK, text)


def _ahead(other_guards: Sequence[str], *, silent_is_obstacle: bool) -> str:
    if silent_is_obstacle:
        return "with silent_is_obstacle the robot does not drive ahead"
    if not other_guards:
        return "nothing stops the robot before an obstacle"
    return f"only {' and '.join(other_guards)} can stop the robot before an obstacle"
