"""A hundred subscribers at 50 Hz: what that costs the daemon, how late they get it, and whether control suffers.

An event's latency runs from the reading of the encoder frame behind it (its ``stamp_s``) to its arrival at the
subscriber: control, odometry, JSON, the writes to all clients before it and the reading of their sockets are inside.
Processor time is measured by turns with that of the floor, which writes the same number of lines to as many clients.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, latencies
from benchmarks.frames import lost
from benchmarks.ratios import FLOOR, by_turns, median
from benchmarks.rig import CHEFBOTD, connect, daemon
from benchmarks.subscribers import subscribers

SUBSCRIBERS = 100
CYCLE_HZ = 50
SECONDS = 6.0
ROUNDS = 3
TWIST = (0.1, 0.4)


@dataclass(frozen=True, slots=True)
class Load:
    """What one program did for its subscribers, once; of the floor only ``cores``."""

    cores: float
    deliveries_hz: float = 0.0
    latencies_s: Sequence[float] = ()
    missed: int = 0
    dropped: int = 0
    faults: tuple[str, ...] = ()


def run(*, quick: bool = False) -> Outcome:
    """Share of a core, its ratio to the floor's, latency over all deliveries, and control steps against frames sent."""
    seconds = SECONDS / 2 if quick else SECONDS
    floor, ours = by_turns(
        1 if quick else ROUNDS, lambda: measure(FLOOR, seconds), lambda: measure(CHEFBOTD, seconds)
    )
    cores, floor_cores = median(ours, "cores"), median(floor, "cores")
    name = f"{SUBSCRIBERS} subscribers at {CYCLE_HZ} Hz"
    delivered_s = [latency_s for load in ours for latency_s in load.latencies_s]
    figures = (
        Figure(name, cores, "core", 0.06, "mosquitto 0.03"),
        Figure(f"{name}, over the floor's", cores / floor_cores, "x"),
        *latencies("delivery", delivered_s, {50: None, 95: 2.0, 99: None}, {95: "mosquitto 0.85"}),
        Figure("control steps missed", sum(load.missed for load in ours), "steps", 0),
        Figure("telemetry dropped", sum(load.dropped for load in ours), "events", 0),
    )
    hz = median(ours, "deliveries_hz")
    remark = (
        f"the floor {floor_cores:.3f} core; {hz:.0f} deliveries a second, of {SUBSCRIBERS * CYCLE_HZ} due"
    )
    return Outcome(figures, remarks=(remark,), faults=tuple(fault for load in ours for fault in load.faults))


def measure(program: Sequence[str], seconds: float) -> Load:
    """One program with all subscribers, the robot driving."""
    with (
        board() as instrument,
        daemon(instrument.device, program=program) as running,
        connect(running) as caller,
    ):
        with subscribers(running.port, SUBSCRIBERS, "odometry") as readers:
            instrument.start(1 / CYCLE_HZ)
            caller.drive_for(1.0, *TWIST)
            readers.forget()
            began_s, before_s = time.monotonic(), running.cpu_s()
            caller.drive_for(seconds, *TWIST)
            elapsed_s, used_s = time.monotonic() - began_s, running.cpu_s() - before_s
            delivered_s = readers.latencies_s()
        if program == FLOOR:
            return Load(used_s / elapsed_s)
        instrument.pause()
        sent = instrument.collect().sent
        faults = lost(caller, sent)
        stats = caller.call("get_stats")
    missed, dropped = sent["e"] - stats["control_steps"], stats["telemetry_dropped"]
    return Load(used_s / elapsed_s, len(delivered_s) / elapsed_s, delivered_s, missed, dropped, faults)
