"""The count of jumps goes on with a new worker, which counts its own from 0."""

from types import SimpleNamespace
from typing import Any

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.service import LocalizationService
from chefbotd.core.events.robot import WorkerReported


class FakeWorker:
    """Says what the test says; ``become_ready`` is called when a new one is there."""

    def __init__(self) -> None:
        self.listeners: dict[type[Any], Any] = {}
        self.become_ready: Any = None

    def add_listener(self, skill: str, kind: type[Any], listener: Any) -> None:
        self.listeners[kind] = listener

    def add_on_ready(self, handler: Any) -> None:
        self.become_ready = handler

    def say(self, stamp_s: float, state: str, jumps: int) -> None:
        """How localization stands, by this worker."""
        self.listeners[LocalizationChanged](
            LocalizationChanged(stamp_s, state, "flat", 0.5, (), 0.0, jumps, "")
        )


def test_jumps_are_counted_over_all_workers() -> None:
    """Two by the first; it is killed; one by the second: never less than before, and a state put back goes on so."""
    worker, bus, told = FakeWorker(), Bus(), list[LocalizationChanged]()
    feed: Any = SimpleNamespace(worker=worker)
    service = LocalizationService(bus, ManualClock(1.0), feed)
    bus.add_handler(told.append, LocalizationChanged)
    worker.become_ready()
    worker.say(1.0, "localized", 1)
    worker.say(1.1, "localized", 2)
    worker.say(1.2, "localized", 2)
    bus.publish(
        WorkerReported(
            stamp_s=2.0, state="restarting", pid=None, restarts=0, rss_mb=None, cpu=None, reason="killed"
        )
    )
    worker.become_ready()
    worker.say(3.0, "searching", 0)
    worker.say(3.1, "localized", 1)
    assert [(each.state, each.jumps) for each in told] == [
        ("localized", 1),
        ("localized", 2),
        ("unknown", 2),
        ("searching", 2),
        ("localized", 3),
    ]
    other = FakeWorker()
    following: Any = SimpleNamespace(worker=other)
    restored = LocalizationService(Bus(), ManualClock(4.0), following)
    restored.restore(service.state())
    other.say(4.2, "localized", 2)
    assert restored.state().latest is not None
    assert restored.state().latest.jumps == 4
