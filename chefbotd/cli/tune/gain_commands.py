"""Commands that set unsaved gains again."""

from collections.abc import Mapping

from chefbotd.cli.tune.gain_steps import Gain
from chefbotd.motion.pid import PidParameters

Wheels = Mapping[str, PidParameters]


def restore_commands(saved: Wheels, gains: Wheels) -> list[str]:
    """The ``chefbotctl pid set`` commands from ``saved`` to ``gains``; one command if all wheels changed alike."""
    changes = {wheel: _changes(saved[wheel], own) for wheel, own in gains.items() if wheel in saved}
    alike = len(set(changes.values())) == 1 and len(changes) > 1
    told = {"all": next(iter(changes.values()))} if alike else changes
    return [f"chefbotctl pid set {wheel} {words}" for wheel, words in told.items() if words]


def _changes(saved: PidParameters, now: PidParameters) -> str:
    before = saved.model_dump()
    return " ".join(
        f"{name}={_word(value)}" for name, value in now.model_dump().items() if value != before[name]
    )


def _word(value: Gain) -> str:
    if value is None:
        return "none"
    return str(value).lower() if isinstance(value, bool) else repr(value)
