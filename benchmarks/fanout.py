"""A hundred subscribers at 50 Hz: what that costs the daemon, how late they get it, and whether control suffers.

An event's latency runs from the reading of the encoder frame behind it (its ``stamp_s``) to its arrival at the
subscriber: control, odometry, JSON, the writes to all clients before it and the reading of their sockets are inside.
"""

import time

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, latencies
from benchmarks.frames import lost
from benchmarks.rig import connect, daemon
from benchmarks.subscribers import subscribers

SUBSCRIBERS = 100
CYCLE_HZ = 50
SECONDS = 12.0
TWIST = (0.1, 0.4)


def run(*, quick: bool = False) -> Outcome:
    """Share of a core, latency over all deliveries, and the control steps held against the frames sent."""
    seconds = SECONDS / 3 if quick else SECONDS
    with board() as instrument, daemon(instrument.device) as running, connect(running) as caller:
        with subscribers(running.port, SUBSCRIBERS, "odometry") as readers:
            instrument.start(1 / CYCLE_HZ)
            caller.drive_for(1.0, *TWIST)
            readers.forget()
            began_s, before_s = time.monotonic(), running.cpu_s()
            caller.drive_for(seconds, *TWIST)
            elapsed_s, used_s = time.monotonic() - began_s, running.cpu_s() - before_s
            delivered_s = readers.latencies_s()
        instrument.pause()
        sent = instrument.collect().sent
        faults = lost(caller, sent)
        stats = caller.call("get_stats")
    figures = (
        Figure(
            f"{SUBSCRIBERS} subscribers at {CYCLE_HZ} Hz", used_s / elapsed_s, "core", 0.06, "mosquitto 0.03"
        ),
        *latencies("delivery", delivered_s, {50: None, 95: 2.0, 99: None}, {95: "mosquitto 0.85"}),
        Figure("control steps missed", sent["e"] - stats["control_steps"], "steps", 0),
        Figure("telemetry dropped", stats["telemetry_dropped"], "events", 0),
    )
    remark = f"{len(delivered_s) / elapsed_s:.0f} deliveries a second, of {SUBSCRIBERS * CYCLE_HZ} due"
    return Outcome(figures, remarks=(remark,), faults=faults)
