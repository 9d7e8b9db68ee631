"""Changes gains while the robot runs, and keeps each change so that any client can undo it."""

from collections.abc import Mapping
from typing import Protocol

from pydantic import ValidationError

from chefbotd.components.tuning.models import SetPidParams, WheelParams, Wheels
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature
from chefbotd.motion.kinematics import ALL_WHEELS
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role

HISTORY_DEPTH = 100
"""The number of changes that can be undone. A key held down on a tuning screen makes about ten a second."""


class Tunable(Protocol):
    """The gains of the control loop."""

    def gains(self) -> Mapping[str, PidParameters]:
        """The gains by wheel name."""
        ...

    def retune(self, gains: Mapping[str, PidParameters]) -> None:
        """Exchange the gains of every wheel without a bump."""
        ...

    def set_gains(self, gains: Mapping[str, PidParameters]) -> None:
        """Restore these gains."""
        ...


class TuningState(MutableState):
    """The gains by wheel name, and the gains before each change."""

    gains: dict[str, PidParameters]
    before: list[dict[str, PidParameters]] = []


class TuningService(StatefulPart[TuningState]):
    """The gains of a running loop, with one history of changes for all clients.

    Output limits must not exceed ``max_duty``, nor be below ``watched_duty``, where a wheel would not be monitored.
    """

    def __init__(
        self, wheels: Tunable, max_duty: int, watched_duty: float = 0.0, depth: int = HISTORY_DEPTH
    ) -> None:
        self._wheels, self._max_duty, self._watched_duty = wheels, max_duty, watched_duty
        self._depth, self.memory = depth, TuningState(dict(wheels.gains()))

    def state(self) -> TuningState:
        """Return the state of this part."""
        self.memory.gains = dict(self._wheels.gains())
        return self.memory

    def restore(self, state: TuningState) -> None:
        """Restore this state."""
        self._wheels.set_gains(state.gains)
        super().restore(state)

    @method(role=Role.OBSERVE)
    def get_pid(self, caller: Caller, params: NoParams) -> Wheels:
        """The gains of every wheel."""
        return Wheels(wheels=dict(self._wheels.gains()))

    @method(role=Role.ADMIN, moves=False, params=SetPidParams)
    def set_pid(self, caller: Caller, params: WheelParams) -> Wheels:
        """Change gains of one wheel or of all wheels at run time; returns the gains of every wheel."""
        return Wheels(wheels=dict(self.change(params.wheel, params.changes())))

    @method(role=Role.ADMIN, moves=False)
    def undo_pid(self, caller: Caller, params: NoParams) -> Wheels:
        """Undo the latest change of gains, whoever made it; returns the gains of every wheel."""
        return Wheels(wheels=dict(self.undo()))

    def change(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change gains of one wheel, or of ``all``; returns the gains of every wheel. Equal values make no history.

        Raises:
            Refused: no such wheel, or a value out of range; nothing changes.
        """
        before = self._wheels.gains()
        if wheel != ALL_WHEELS and wheel not in before:
            names = ", ".join([ALL_WHEELS, *before])
            raise Refused(
                RefusalKind.UNKNOWN_WHEEL,
                Sentence(
                    "tuning.unknown_wheel",
                    "no wheel named {wheel!r}; there are {others}",
                    wheel=wheel,
                    others=names,
                ),
            )
        after = {
            name: _change_gains(gains, changes) if wheel in (ALL_WHEELS, name) else gains
            for name, gains in before.items()
        }
        if expected := self._expected_of_limits(after):
            reason = Sentence(
                "tuning.output_limit",
                "the output cannot be limited to {value}: expected {expected}",
                value=changes["output_limit"],
                expected=expected,
            )
            raise Refused(RefusalKind.OUT_OF_RANGE, reason)
        if after != before:
            self._wheels.retune(after)
            self.memory.before.append(dict(before))
            del self.memory.before[: -self._depth]
        return after

    def undo(self) -> Mapping[str, PidParameters]:
        """Undo the latest change without a jump in the duty; returns the gains of every wheel.

        Raises:
            Refused: no change is left to take back.
        """
        if not self.memory.before:
            raise Refused(
                RefusalKind.NOTHING_TO_UNDO,
                Sentence("tuning.nothing_to_undo", "there is no change of gains to undo"),
            )
        self._wheels.retune(self.memory.before.pop())
        return self._wheels.gains()

    def _expected_of_limits(self, gains: Mapping[str, PidParameters]) -> str | None:
        """The rule for output limits that these gains break; None if they break none."""
        limits = [own.output_limit for own in gains.values()]
        if max(limits) > self._max_duty:
            return f"at most {self._max_duty}, the duty's range"
        if round(min(limits)) <= self._watched_duty:
            return f"more than {self._watched_duty:g}, because a stalled wheel is not detected at or below it"
        return None


def _change_gains(old: PidParameters, changes: Mapping[str, object]) -> PidParameters:
    try:
        return PidParameters.model_validate(old.model_dump() | dict(changes))
    except ValidationError as error:
        why = "; ".join(f"{'.'.join(map(str, e['loc']))}={e['input']!r}: {e['msg']}" for e in error.errors())
        raise Refused(RefusalKind.OUT_OF_RANGE, Sentence("tuning.invalid", "{why}", why=why)) from error


def tuning(service: TuningService) -> Feature:
    """The feature that changes gains while the robot runs."""
    return Feature("tuning", methods=methods_of(service), parts={"gains": service}, configured=("gains",))
