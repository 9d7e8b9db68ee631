"""Reports a change of the gate's state to the bus, the log, and the latch file for the next daemon."""

import structlog

from chefbotd.bus import Bus
from chefbotd.core.events import SafetyChanged
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.logs import RateLimitedLog
from chefbotd.safety.faults import UNSTOPPED
from chefbotd.safety.gate import GateState, Mode
from chefbotd.safety.latch import GateStore

log = structlog.get_logger(component="safety")


class AnnouncerState(MutableState, array_like=True):
    """The last announcement, and how often each kind of fault was latched."""

    announced: SafetyChanged | None = None
    faults: dict[str, int] = {}


class GateAnnouncer(StatefulPart[AnnouncerState]):
    """``latch`` keeps the mode beyond the end of the process."""

    def __init__(self, bus: Bus, latch: GateStore) -> None:
        self._bus, self._latch = bus, latch
        self.memory = AnnouncerState()
        self._limited_log = RateLimitedLog(log)

    def store(self, state: GateState) -> str:
        """Keep a state for the next daemon before it is in force. Why it cannot be kept; empty: it is."""
        return self._latch.keep(state)

    def announce(self, event: SafetyChanged, state: GateState) -> None:
        """Publish a change, keep ``state`` for the next daemon, and log the change."""
        before, self.memory.announced = self.memory.announced, event
        is_new_fault = event.fault is not None and (before is None or before.fault != event.fault)
        if is_new_fault:
            faults, kind = self.memory.faults, str(event.fault)
            faults[kind] = faults.get(kind, 0) + 1
        self._latch.keep(state)
        self._bus.publish(event)
        if event.limited_by is not None and (before is None or before.limited_by != event.limited_by):
            self._limited_log.warning("motion limited", by=event.limited_by)
        if before is not None and before.mode != event.mode:
            logged = log.info if state.mode is Mode.ARMED else log.warning
            logged("safety mode changed", mode=str(event.mode), reason=event.reason, fault=event.fault)
        elif is_new_fault and event.fault in UNSTOPPED:
            log.error("the robot moves although it must stand", reason=event.reason, fault=event.fault)
