"""The last lines each way, and their way into the log."""

import asyncio
from typing import Any

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import run_virtual
from chefbotd.core.events import SafetyChanged
from chefbotd.link.board_writer import LINES_KEPT, LINES_LOGGED, FaultLog, LineRing


def changed(stamp_s: float, mode: str, fault: str | None) -> SafetyChanged:
    """A report of the gate's state."""
    return SafetyChanged(stamp_s, mode, "a reason", None, fault=fault)


def dumps(*changes: SafetyChanged) -> list[dict[str, Any]]:
    """What is logged when these happen, each at its own time."""

    async def run() -> None:
        bus, ring = Bus(), LineRing()
        ring.heard.append((1.0, [b"e\t1\t2"]))
        task = asyncio.create_task(FaultLog(bus, ring).run())
        start_s = asyncio.get_running_loop().time()
        for change in changes:
            await asyncio.sleep(max(0.0, start_s + change.stamp_s - asyncio.get_running_loop().time()))
            bus.publish(change)
        await asyncio.sleep(1.0)
        task.cancel()

    with structlog.testing.capture_logs() as written:
        run_virtual(run())
    return [dict(line) for line in written]


def test_both_ways_are_told_in_the_order_of_time():
    """Seconds before the fault, the direction, the line with its tab shown."""
    ring = LineRing()
    ring.heard.extend([(9.0, [b"e\t1\t2", b"u\t7"]), (9.9, [b"\xff"])])
    ring.said.append((9.5, b"s 1 2"))
    assert ring.as_text(10.0) == ["-1.000 < e\\t1\\t2", "-1.000 < u\\t7", "-0.500 > s 1 2", "-0.100 < \\xff"]


def test_only_the_newest_are_kept():
    """Of 1000 reads and as many commands the last 200 stay, each way; the log has the last 20 lines of both."""
    ring = LineRing()
    for number in range(1000):
        ring.heard.append((number, [b"%d" % number]))
        ring.said.append((number, b"%d" % number))
    told = ring.as_text(1000.0, most=1000)
    assert len(told) == 2 * LINES_KEPT
    assert told[0] == "-200.000 < 800"
    assert ring.as_text(1000.0) == told[-LINES_LOGGED:]


def test_a_fault_is_dumped_once():
    """When a fault latches the lines are logged with its name; that it is still there is not another."""
    (dump,) = dumps(changed(2.0, "disarmed", "link_lost"), changed(2.1, "disarmed", "link_lost"))
    assert (dump["fault"], dump["lines"]) == ("link_lost", ["-1.000 < e\\t1\\t2"])


def test_a_users_stop_is_no_fault():
    """An e-stop that a client asked for leaves the log alone, and so does arming."""
    assert dumps(changed(0.0, "armed", None), changed(1.0, "estopped", None)) == []


def test_faults_that_repeat_are_dumped_now_and_then():
    """A link that comes and goes every second for 21 s: dumps at 0, 10 and 20 s."""
    flapping = [
        changed(second + half, "disarmed" if not half else "armed", None if half else "link_lost")
        for second in range(21)
        for half in (0.0, 0.5)
    ]
    assert len(dumps(*flapping)) == 3
