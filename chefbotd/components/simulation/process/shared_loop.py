"""An event loop on a clock that several programs share: where it would wait, it waits for the next tick or for input."""

import asyncio
import selectors

from chefbotd.shared_clock import SharedClock

Ready = list[tuple[selectors.SelectorKey, int]]


class _TickingSelector(selectors.DefaultSelector):
    def __init__(self, clock: SharedClock) -> None:
        super().__init__()
        self._clock = clock
        self._ticks = self.register(clock.socket, selectors.EVENT_READ)

    def select(self, timeout: float | None = None) -> Ready:
        """What is ready, or nothing once the clock has gone on for so long."""
        clock = self._clock
        until_s = None if timeout is None else clock.now_s() + max(timeout, 0.0)
        ready = self._look(0)
        while not ready and (until_s is None or clock.now_s() < until_s):
            clock.done()
            ready = self._look(None)
        return ready

    def _look(self, timeout_s: float | None) -> Ready:
        ready = super().select(timeout_s)
        others = [entry for entry in ready if entry[0] is not self._ticks]
        if len(others) < len(ready):
            self._clock.receive()
        return others


class SharedClockLoop(asyncio.SelectorEventLoop):
    """Time as a shared clock has it. What comes from programs that do not keep to that clock is not waited for."""

    def __init__(self, clock: SharedClock) -> None:
        self._clock = clock
        super().__init__(_TickingSelector(clock))

    def time(self) -> float:
        """Seconds on the shared clock."""
        return self._clock.now_s()
