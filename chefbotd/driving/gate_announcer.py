"""Reports a change of the gate's state to the bus, the log, and the latch file for the next daemon."""

from collections import Counter

import structlog

from chefbotd.bus import Bus
from chefbotd.core.events import SafetyChanged
from chefbotd.logs import RateLimitedLog
from chefbotd.safety.faults import UNSTOPPED
from chefbotd.safety.gate import GateState, Mode
from chefbotd.safety.latch import GateStore

log = structlog.get_logger(component="safety")


class GateAnnouncer:
    """``latch`` keeps the mode beyond the end of the process; ``faults`` counts latched faults by kind."""

    def __init__(self, bus: Bus, latch: GateStore) -> None:
        self._bus, self._latch = bus, latch
        self._announced: SafetyChanged | None = None
        self.faults: Counter[str] = Counter()
        self._limited_log = RateLimitedLog(log)

    def state(self) -> tuple[SafetyChanged | None, dict[str, int]]:
        """The last announcement, and the count of each fault."""
        return self._announced, self.faults

    def restore(self, state: tuple[SafetyChanged | None, dict[str, int]]) -> None:
        """Restore this state."""
        self._announced, self.faults = state[0], Counter(state[1])

    def store(self, state: GateState) -> str:
        """Keep a state for the next daemon before it is in force. Why it cannot be kept; empty: it is."""
        return self._latch.keep(state)

    def announce(self, event: SafetyChanged, state: GateState) -> None:
        """Publish a change, keep ``state`` for the next daemon, and log the change."""
        before, self._announced = self._announced, event
        is_new_fault = event.fault is not None and (before is None or before.fault != event.fault)
        if is_new_fault:
            self.faults[str(event.fault)] += 1
        self._latch.keep(state)
        self._bus.publish(event)
        if event.limited_by is not None and (before is None or before.limited_by != event.limited_by):
            self._limited_log.warning("motion limited", by=event.limited_by)
        if before is not None and before.mode != event.mode:
            logged = log.info if state.mode is Mode.ARMED else log.warning
            logged("safety mode changed", mode=str(event.mode), reason=event.reason, fault=event.fault)
        elif is_new_fault and event.fault in UNSTOPPED:
            log.error("the robot moves although it must stand", reason=event.reason, fault=event.fault)
