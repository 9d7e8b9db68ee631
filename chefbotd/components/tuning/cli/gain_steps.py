"""The effect of a key on a gain, by the short names of ``PidParameters``. A step up undoes a step down."""

from collections.abc import Mapping
from math import floor, log10
from typing import TypeAlias

from chefbotd.motion.pid import PidParameters

Gain: TypeAlias = float | bool | None

FIRST_STEP: Mapping[str, float] = {
    "kp": 10.0,
    "ki": 10.0,
    "kd": 1.0,
    "ks": 5.0,
    "kv": 100.0,
    "ka": 10.0,
    "output_limit": 10.0,
    "integral_limit": 10.0,
    "deadband": 0.001,
    "derivative_filter_s": 0.005,
    "back_calculation_s": 0.1,
}
"""The value after the first step up from zero, in the gain's own unit."""

CAN_BE_OFF = {"integral_limit", "back_calculation_s"}
COARSE, FINE = 0.1, 0.01
DIGITS = 4


def step_gain(name: str, value: Gain, direction: int, share: float = COARSE) -> Gain:
    """The gain after one step up (``direction`` 1) or down (-1) by ``share`` of its value; a boolean is toggled.

    Below a tenth of its first step a gain becomes zero, or None if it can be off. The next step up is the first step.
    """
    if isinstance(value, bool):
        return not value
    first = FIRST_STEP[name]
    if not value:
        return first if direction > 0 else value
    after = _round_gain(value * (1 + share) if direction > 0 else value / (1 + share))
    if after < first / 10:
        return None if name in CAN_BE_OFF else 0.0
    return after


def _round_gain(value: float) -> float:
    """Four significant digits: finer than any step, and short to read."""
    return round(value, DIGITS - 1 - floor(log10(value)))


Wheels = Mapping[str, PidParameters]


def restore_commands(saved: Wheels, gains: Wheels) -> list[str]:
    """The ``chefbotctl pid set`` commands from ``saved`` to ``gains``; one command if all wheels changed alike."""
    changes = {wheel: _changes(saved[wheel], own) for wheel, own in gains.items() if wheel in saved}
    alike = len(set(changes.values())) == 1 and len(changes) > 1
    changes_by_wheel = {"all": next(iter(changes.values()))} if alike else changes
    return [f"chefbotctl pid set {wheel} {words}" for wheel, words in changes_by_wheel.items() if words]


def _changes(saved: PidParameters, now: PidParameters) -> str:
    before = saved.model_dump()
    return " ".join(
        f"{name}={_word(value)}" for name, value in now.model_dump().items() if value != before[name]
    )


def _word(value: Gain) -> str:
    if value is None:
        return "none"
    return str(value).lower() if isinstance(value, bool) else repr(value)
