"""The daemon with stopwatches at its doors: how much processor time each kind of work takes while it really runs.

``python -m benchmarks.stopwatch FILE run ...`` is ``chefbotd run ...``, and at its end FILE holds processor seconds by
part. Time in a part is exclusive of the parts that it calls; what no part accounts for is the event loop, its system
calls, and the services between the parts. In a tight loop on warm caches the same work takes a third of this or less.
"""

import functools
import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from chefbotd.cli.programs.chefbotd import main
from chefbotd.link.board_clock import BoardClock
from chefbotd.link.port import SerialPortTransport
from chefbotd.link.session import BoardSession
from chefbotd.motion import encoder, odometry
from chefbotd.motion.drive import Drive
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.fanout import Feed
from chefbotd.safety import gate
from chefbotd.sensing import battery, imu, ultrasonic
from chefbotd.transport.outbox import Outbox
from firmware_protocol.decoder import Decoder

DOORS: dict[str, tuple[tuple[Any, str], ...]] = {
    "parsing": ((Decoder, "feed"),),
    "link": ((BoardSession, "data_received"), (BoardClock, "observe"), (BoardSession, "send_duty")),
    "motor command to the device": ((SerialPortTransport, "write"),),
    "control": (
        (encoder, "decode"),
        (gate, "decide"),
        (Drive, "regulate"),
        (Drive, "retarget"),
        (Drive, "targets_rad_s"),
    ),
    "odometry": ((odometry, "integrate"),),
    "sensors": ((ultrasonic, "interpret"), (imu, "from_quaternion"), (battery, "measure")),
    "JSON": ((Feed, "payload"), (jsonrpc, "event")),
    "writing to clients": ((Outbox, "telemetry"),),
    "requests": ((Dispatcher, "serve"),),
}

now_s = time.thread_time  # what the processor did for us: waiting while others run is not in it


class Stopwatch:
    """Exclusive seconds by part: a call inside another stops the outer one's watch."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._inner_s = [0.0]

    def watch(self, part: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, timed."""
        inner_s, seconds = self._inner_s, self.seconds

        @functools.wraps(work)
        def timed(*args: Any, **kwargs: Any) -> Any:
            inner_s.append(0.0)
            began_s = now_s()
            try:
                return work(*args, **kwargs)
            finally:
                took_s = now_s() - began_s
                seconds[part] += took_s - inner_s.pop()
                inner_s[-1] += took_s

        return timed


def run(report: Path) -> None:
    """Run the daemon's command line under the watches."""
    stopwatch = Stopwatch()
    for part, doors in DOORS.items():
        for owner, name in doors:
            setattr(owner, name, stopwatch.watch(part, getattr(owner, name)))
    try:
        main()
    finally:
        report.write_text(json.dumps(stopwatch.seconds))


if __name__ == "__main__":
    path = Path(sys.argv.pop(1))
    run(path)
