"""Applies a changed configuration while the robot runs, and names the keys that need a restart.

Gains change without a bump, limits as soon as the robot stands, the log's level and the tokens at once. Everything else
is built into the parts of the daemon, and waits for its next start.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from msgspec import Struct
from pydantic import ValidationError

from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.access import AccessError, Keyring
from chefbotd.settings import Settings, SettingsError
from chefbotd.settings.checks import check
from chefbotd.settings.model import Level

CHANGEABLE = ("pid", "wheel_pid", "limits", "log")
"""The sections that a running daemon takes over."""

RESTART = "it is fixed while the daemon runs: sudo systemctl restart chefbotd"
ABSENT = object()


class ReloadTarget(Protocol):
    """What the changes go to: the running daemon."""

    def gains(self) -> Mapping[str, PidParameters]:
        """The present gains by wheel name."""
        ...

    def exchange_gains(self, gains: Mapping[str, PidParameters]) -> None:
        """Exchange the gains of every wheel without a bump."""
        ...

    def exchange_limits(self, limits: MotionLimits) -> bool:
        """Exchange the limits as soon as the robot stands; whether it was at once."""
        ...

    def set_level(self, level: Level) -> None:
        """Log from this level on."""
        ...

    def load_keyring(self, settings: Settings) -> Keyring | None:
        """The tokens as their file has them now, None where none are asked for; raises ``AccessError``."""
        ...

    def renew_certificate(self, settings: Settings) -> bool:
        """Take the certificate as its files have it now; False where there is none; raises ``AccessError``."""
        ...

    def exchange_tokens(self, keyring: Keyring) -> None:
        """Let these tokens open the socket, and no others."""
        ...


class ReloadOutcome(Struct, frozen=True):
    """The result of a reload: the keys in force, those that wait until the robot stands, and refusals."""

    changed: tuple[str, ...] = ()
    waiting: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()

    def __str__(self) -> str:
        parts = [
            f"changed {', '.join(self.changed)}" if self.changed else "",
            f"when the robot stands: {', '.join(self.waiting)}" if self.waiting else "",
            "; ".join(self.refused),
        ]
        return "; ".join(filter(None, parts)) or "nothing has changed"


class Reloader:
    """``settings`` are those in force."""

    def __init__(self, settings: Settings, target: ReloadTarget) -> None:
        self._settings, self._target = settings, target

    def apply(self, settings: Settings) -> ReloadOutcome:
        """Take over what may change.

        Raises:
            SettingsError: what may change does not go with what may not; nothing has changed.
            AccessError: the tokens or the certificate cannot be read; nothing has changed.
        """
        before = self._settings
        merged = before.model_copy(update={name: getattr(settings, name) for name in CHANGEABLE})
        if wrong := "; ".join(check(merged)):
            raise SettingsError(f"does not fit the settings that only a restart changes: {wrong}")
        keyring = self._target.load_keyring(before)
        has_tls = self._target.renew_certificate(before)
        self._settings = merged
        keys = list(_differences("", _plain(before), _plain(settings)))
        return _outcome(
            keys, self._exchange(before, merged), has_tokens=self._open_to(keyring), has_tls=has_tls
        )

    def _exchange(self, before: Settings, after: Settings) -> bool:
        """Apply gains, limits and the log's level where they differ; returns whether the limits hold at once."""
        self._retune(before, after)
        at_once = before.limits == after.limits or self._target.exchange_limits(after.limits)
        if after.log.level != before.log.level:
            self._target.set_level(after.log.level)
        return at_once

    def _open_to(self, keyring: Keyring | None) -> bool:
        """Exchange the tokens, if any are asked for."""
        if keyring is not None:
            self._target.exchange_tokens(keyring)
        return keyring is not None

    def _retune(self, before: Settings, after: Settings) -> None:
        """The gains that the file has changed. Gains that only ``set_pid`` has changed stay."""
        was, running, new = before.gains(), self._target.gains(), after.gains()
        gains = {name: _merge_gains(was[name], running[name], new[name]) for name in new}
        if gains != running:
            self._target.exchange_gains(gains)


def _merge_gains(was: PidParameters, running: PidParameters, new: PidParameters) -> PidParameters:
    """The running gains with the file's changes; the file's gains if the two do not fit together."""
    said, old = new.model_dump(), was.model_dump()
    changed = {name: value for name, value in said.items() if value != old[name]}
    try:
        return PidParameters.model_validate(running.model_dump() | changed)
    except ValidationError:
        return new


def _outcome(keys: Sequence[str], at_once: bool, *, has_tokens: bool, has_tls: bool) -> ReloadOutcome:
    """Sort the keys that differ. ``at_once``: the limits did not have to wait until the robot stands."""
    mine = [key for key in keys if key.partition(".")[0] in CHANGEABLE]
    waiting = () if at_once else tuple(key for key in mine if key.startswith("limits"))
    changed = tuple(key for key in mine if key not in waiting)
    return ReloadOutcome(
        changed=(
            *changed,
            *(("the tokens were read",) if has_tokens else ()),
            *(("the certificate was read",) if has_tls else ()),
        ),
        waiting=waiting,
        refused=tuple(f"{key}: {RESTART}" for key in keys if key not in mine),
    )


def _plain(settings: Settings) -> dict[str, Any]:
    plain = settings.model_dump(mode="json", by_alias=True)
    plain["plugins"]["settings"] = settings.plugins.settings  # which JSON leaves out
    return plain


def _differences(key: str, before: object, after: object) -> Iterator[str]:
    """The keys whose values differ, as dotted as the configuration's own."""
    if isinstance(before, dict) and isinstance(after, dict):
        for name in {**before, **after}:
            inner = f"{key}.{name}" if key else name
            yield from _differences(inner, before.get(name, ABSENT), after.get(name, ABSENT))
    elif _is_named(before) and _is_named(after):
        yield from _differences(key, _by_name(before), _by_name(after))
    elif before != after:
        yield key


def _is_named(value: object) -> bool:
    """Whether this is a list of sections that each have a name, such as ``[[chassis.wheels]]``."""
    return isinstance(value, list) and all(isinstance(entry, dict) and "name" in entry for entry in value)


def _by_name(entries: Any) -> dict[str, object]:
    return {entry["name"]: entry for entry in entries}


CANNOT_RELOAD = (SettingsError, AccessError, OSError)
"""A change of nothing."""
