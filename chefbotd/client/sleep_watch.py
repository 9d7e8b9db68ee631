"""Notices that a program which drives did not run for longer than the robot obeys a command.

A stopped process (Ctrl-Z, a debugger, swapping) or a suspended computer sends no commands, and the robot brakes. When
the program runs again, people have long taken the motion for ended: it must not go on by itself.
"""

from __future__ import annotations

import asyncio

from chefbotd.clock import suspended_s

PERIOD_S = 0.1
"""How often the watch proves that its event loop runs. Whatever passed beyond it is sleep."""

KEPT_S = 2.0
"""The watch of a command ends so long after it: a program that pauses on purpose is not watched."""


class SleepWatch:
    """Watches the running event loop from the first ``renew`` on, until the last one runs out.

    ``Client.drive`` has one of its own. Programs that send the robot to goals use one with ``renew(math.inf)``.
    Times are the loop's, plus what the computer was suspended, which the loop's clock leaves out.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._due_s = 0.0
        self._left_s = 0.0
        self._longest_s = 0.0

    def renew(self, for_s: float = KEPT_S) -> None:
        """Watch for so many seconds from now on, in which the loop runs."""
        self._left_s = for_s
        if self._timer is None:
            self._set_timer()

    def stop(self) -> None:
        """Watch no longer, and forget what was noticed."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._longest_s = None, 0.0

    def slept_s(self) -> float:
        """The longest time in seconds, since the watch began, for which the loop did not run; 0 without a watch."""
        if self._timer is not None:
            self._longest_s = max(self._longest_s, self._now_s() - self._due_s)
        return self._longest_s

    def _now_s(self) -> float:
        return self._loop.time() + suspended_s()

    def _set_timer(self) -> None:
        self._due_s = self._now_s() + PERIOD_S
        self._timer = self._loop.call_later(PERIOD_S, self._tick)

    def _tick(self) -> None:
        self.slept_s()
        self._left_s -= PERIOD_S  # not what it slept: that is still to be told
        if self._left_s > 0:
            self._set_timer()
        else:
            self.stop()
