"""Changes of gains and their undoing, over a loop that keeps whatever it is given."""

import contextlib
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.tuning.service import TuningService
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.models import NoParams
from tests.budget import examples

START = PidParameters(kp=400.0, ki=100.0, output_limit=1023.0, back_calculation_s=0.5)


class Loop:
    """Two wheels' gains."""

    def __init__(self) -> None:
        self._gains: Mapping[str, PidParameters] = {"left": START, "right": START}

    def gains(self) -> Mapping[str, PidParameters]:
        return dict(self._gains)

    def retune(self, gains: Mapping[str, PidParameters]) -> None:
        self._gains = dict(gains)


def gains_of(tuning: TuningService) -> Mapping[str, PidParameters]:
    """What every wheel has, as a client is told."""
    nobody: Any = None
    return tuning.get_pid(nobody, NoParams()).wheels


def test_gains_change_per_wheel_or_for_all() -> None:
    """One wheel's gain changes alone, 'all' changes both; the answer has every wheel, and the loop has it."""
    loop = Loop()
    tuning = TuningService(loop, 1023)
    tuning.change("left", {"kp": 5.0})
    changed = tuning.change("all", {"ki": 7.0})
    assert {name: (g.kp, g.ki) for name, g in changed.items()} == {"left": (5.0, 7.0), "right": (400.0, 7.0)}
    assert loop.gains() == changed


@pytest.mark.parametrize(
    ("wheel", "changes", "kind", "told"),
    [
        ("middle", {"kp": 1.0}, RefusalKind.UNKNOWN_WHEEL, "all, left, right"),
        ("all", {"kp": -1.0}, RefusalKind.OUT_OF_RANGE, "-1.0"),
        ("all", {"kq": 1.0}, RefusalKind.OUT_OF_RANGE, "kq"),
    ],
)
def test_bad_gains_are_refused_and_change_nothing(
    wheel: str, changes: dict[str, object], kind: RefusalKind, told: str
) -> None:
    """The refusal names the value or the wheels there are."""
    tuning = TuningService(Loop(), 1023)
    with pytest.raises(Refused, match=told) as refusal:
        tuning.change(wheel, changes)
    assert refusal.value.kind is kind
    assert gains_of(tuning) == {"left": START, "right": START}


def test_a_change_is_taken_back() -> None:
    """After ``undo`` every wheel has what it had, also where a gain was switched off."""
    tuning = TuningService(Loop(), 1023)
    changed = tuning.change("all", {"kp": 500.0, "back_calculation_s": None})
    assert {g.kp for g in changed.values()} == {500.0}
    assert tuning.undo() == {"left": START, "right": START} == gains_of(tuning)


def test_nothing_is_left_to_undo() -> None:
    """Without a change there is nothing to take back, and that is a refusal of its own kind."""
    with pytest.raises(Refused) as refused:
        TuningService(Loop(), 1023).undo()
    assert refused.value.kind is RefusalKind.NOTHING_TO_UNDO


def test_what_changed_nothing_is_not_remembered() -> None:
    """A refused change, and one to the present values, leave the history as it was."""
    tuning = TuningService(Loop(), 1023)
    tuning.change("left", {"kp": 420.0})
    tuning.change("left", {"kp": 420.0})
    with pytest.raises(Refused):
        tuning.change("left", {"kp": -1})
    assert tuning.undo()["left"] == START


def test_the_history_is_bounded() -> None:
    """With room for two, the third change pushes the first out: two can be taken back."""
    tuning = TuningService(Loop(), 1023, depth=2)
    for kp in (1.0, 2.0, 3.0):
        tuning.change("all", {"kp": kp})
    assert [tuning.undo()["left"].kp for _ in range(2)] == [2.0, 1.0]
    with pytest.raises(Refused):
        tuning.undo()


CHANGES = st.tuples(st.sampled_from(["left", "right", "all"]), st.sampled_from([1.0, 2.0, 400.0]))


@settings(max_examples=examples(50))
@given(st.lists(CHANGES, max_size=8))
def test_undoing_everything_is_the_beginning(changes: list[tuple[str, float]]) -> None:
    """Whatever was changed on whichever wheel, undoing until refused ends with the first gains."""
    tuning = TuningService(Loop(), 1023)
    for wheel, kp in changes:
        tuning.change(wheel, {"kp": kp})
    with contextlib.suppress(Refused):
        while True:
            tuning.undo()
    assert gains_of(tuning) == {"left": START, "right": START}


def test_no_gain_reaches_beyond_the_duty_range():
    """An output limit above the bridge's range is refused with both numbers, and nothing changes."""
    loop = Loop()
    tuning = TuningService(loop, 1023)
    before = gains_of(tuning)
    with pytest.raises(Refused, match=r"limited to 30000: expected at most 1023") as refusal:
        tuning.change("all", {"output_limit": 30000, "kv": 80000})
    assert refusal.value.kind is RefusalKind.OUT_OF_RANGE
    assert gains_of(tuning) == before


def test_no_output_limit_blinds_the_watch_over_the_wheels():
    """Wheels are watched from a duty of 122.76 on: a limit of 122 is refused with both numbers, 123 is taken."""
    tuning = TuningService(Loop(), 1023, 122.76)
    with pytest.raises(Refused, match=r"limited to 122: expected more than 122.76") as refusal:
        tuning.change("left", {"output_limit": 122})
    assert refusal.value.kind is RefusalKind.OUT_OF_RANGE
    assert tuning.change("left", {"output_limit": 123})["left"].output_limit == 123.0
