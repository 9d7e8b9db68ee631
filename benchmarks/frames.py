"""Whether every line that the board sent was read, understood and acted upon."""

from collections import Counter
from contextlib import suppress

from benchmarks.rig import NotReady, until
from benchmarks.rpc import Caller

NAMES = {
    "t": "BoardTime",
    "e": "EncoderCounts",
    "u": "UltrasonicDistance",
    "s": "DutyEcho",
    "i": "Orientation",
    "b": "BatteryLevel",
}


def lost(caller: Caller, sent: Counter[str]) -> tuple[str, ...]:
    """Wait for the daemon to have read it all; then what is missing, refused or dropped, each as a sentence."""
    with suppress(NotReady):  # the comparison below says what is missing
        until(lambda: caller.call("get_stats")["control_steps"] >= sent["e"], "frames are missing")
    stats = caller.call("get_stats")
    read = {kind: stats["frames"].get(name, 0) for kind, name in NAMES.items()}
    faults = [f"{n} '{kind}' lines sent, {read[kind]} read" for kind, n in sent.items() if n != read[kind]]
    faults += [f"{counter}: {stats[counter]}" for counter in ("refused", "bus_dropped") if stats[counter]]
    if stats["control_steps"] != sent["e"]:
        faults.append(f"{sent['e']} encoder frames sent, {stats['control_steps']} control steps")
    return tuple(faults)
