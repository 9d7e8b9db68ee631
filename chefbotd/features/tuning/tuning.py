"""Changes gains while the robot runs, and keeps each change so that any client can undo it."""

from collections import deque
from collections.abc import Mapping
from typing import Protocol

from pydantic import ValidationError

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.motion.pid import PidParameters

HISTORY_DEPTH = 100
"""So many changes can be taken back: a key held down on a tuning screen makes some ten a second."""

ALL_WHEELS = "all"


class Tunable(Protocol):
    """The control loop, as far as its gains go."""

    def gains(self) -> Mapping[str, PidParameters]:
        """The gains by wheel name."""
        ...

    def retune(self, gains: Mapping[str, PidParameters]) -> None:
        """Exchange the gains of every wheel without a bump."""
        ...


class Tuning:
    """The gains of a running loop and what they were: one history for all clients.

    No output goes past ``max_duty``, and none is kept so low that a wheel would not be watched, below ``watched_duty``.
    """

    def __init__(
        self, wheels: Tunable, max_duty: int, watched_duty: float = 0.0, depth: int = HISTORY_DEPTH
    ) -> None:
        self._wheels, self._max_duty, self._watched_duty = wheels, max_duty, watched_duty
        self._before: deque[Mapping[str, PidParameters]] = deque(maxlen=depth)

    def gains(self) -> Mapping[str, PidParameters]:
        """The gains by wheel name."""
        return self._wheels.gains()

    def change(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change gains of one wheel, or of ``all``; what every wheel now has. What changes nothing is not remembered.

        Raises:
            Refused: no such wheel, or a value out of range; nothing changes.
        """
        before = self._wheels.gains()
        if wheel != ALL_WHEELS and wheel not in before:
            known = ", ".join([ALL_WHEELS, *before])
            raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel named {wheel!r}; there are {known}")
        after = {
            name: _changed(gains, changes) if wheel in (ALL_WHEELS, name) else gains
            for name, gains in before.items()
        }
        if expected := self._expected_of_limits(after):
            told = f"output_limit={changes['output_limit']!r}: expected {expected}"
            raise Refused(RefusalKind.OUT_OF_RANGE, told)
        if after != before:
            self._wheels.retune(after)
            self._before.append(before)
        return after

    def undo(self) -> Mapping[str, PidParameters]:
        """Take the latest change back, as free of bumps as it was made; what every wheel now has.

        Raises:
            Refused: no change is left to take back.
        """
        if not self._before:
            raise Refused(RefusalKind.NOTHING_TO_UNDO, "there is no change of gains to undo")
        self._wheels.retune(self._before.pop())
        return self._wheels.gains()

    def _expected_of_limits(self, gains: Mapping[str, PidParameters]) -> str | None:
        """What is asked of the output limits, if one is not so."""
        limits = [each.output_limit for each in gains.values()]
        if max(limits) > self._max_duty:
            return f"at most {self._max_duty}, the duty's range"
        if round(min(limits)) <= self._watched_duty:
            return f"more than {self._watched_duty:g}, because a stalled wheel is not detected at or below it"
        return None


def _changed(old: PidParameters, changes: Mapping[str, object]) -> PidParameters:
    try:
        return PidParameters.model_validate(old.model_dump() | dict(changes))
    except ValidationError as error:
        told = "; ".join(f"{'.'.join(map(str, e['loc']))}={e['input']!r}: {e['msg']}" for e in error.errors())
        raise Refused(RefusalKind.OUT_OF_RANGE, told) from error
