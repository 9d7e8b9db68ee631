"""The rule of what a stop holds, as a question to all that has happened so far; docs/safety.md has it in words."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

PAUSE_S, TAKING_PAUSE_S = 1.0, 5.0


@dataclass(frozen=True, slots=True)
class Deed:
    """What a connection did: ``try``, ``stop``, ``estop``, or ``ask`` (``source`` empty: for every source).

    ``fault``: nobody did it. ``latched``: an emergency stop or a fault was in force.
    """

    at_s: float
    client: int
    what: str
    source: str = ""
    latched: bool = False


Deeds = tuple[Deed, ...]


@lru_cache(1 << 16)
def is_held(deeds: Deeds, client: int, source: str, now_s: float) -> bool:
    """Whether this client may not drive this source now, because of a stop."""
    return any(
        not _knows(deeds, i, client, source) and _held_until_s(deeds, i, source, now_s) is not None
        for i in range(len(deeds))
    )


@lru_cache(1 << 16)
def _held_until_s(deeds: Deeds, i: int, source: str, now_s: float) -> float | None:
    """The last try of those whom the stop ``i`` holds; None where it holds nobody, or they have paused since."""
    began_s = _begins(deeds[: i + 1], source)
    if began_s is None:
        return None
    moments_s = [began_s]
    for k in range(i, len(deeds)):
        deed = deeds[k]
        if (deed.what, deed.source) == ("try", source) and not _knows(deeds[:k], i, deed.client, source):
            moments_s.append(deed.at_s)
    paused = any(later_s - earlier_s >= PAUSE_S for earlier_s, later_s in pairwise([*moments_s, now_s]))
    return None if paused else moments_s[-1]


def _begins(deeds: Deeds, source: str) -> float | None:
    """Since when those whom the last deed, a stop, holds have not tried; None where it holds nobody."""
    before, stop = deeds[:-1], deeds[-1]
    tries = [each for each in before if (each.what, each.source) == ("try", source)]
    if stop.what == "try" and stop.latched and stop.source == source:
        return stop.at_s
    if stop.what not in ("stop", "estop", "fault"):
        return None
    free = stop.client if stop.what == "stop" else None
    lately = [each for each in tries if stop.at_s - each.at_s < PAUSE_S and each.client != free]
    if not lately:
        return None
    if is_held(before, stop.client, source, stop.at_s):
        free = None
    own_s = max(each.at_s for each in tries if each.client != free)
    still_s = [_held_until_s(before, k, source, stop.at_s) for k in range(len(before))]
    return max([own_s, *(each_s for each_s in still_s if each_s is not None)])


@lru_cache(1 << 16)
def _knows(deeds: Deeds, i: int, client: int, source: str) -> bool:
    """Whether a client has sent the stop ``i`` while it was free, or has asked to drive after it."""
    if i >= len(deeds):
        return False
    stop = deeds[i]
    if stop.what == "stop" and stop.client == client and not is_held(deeds[:i], client, source, stop.at_s):
        return True
    return any(
        each.what == "ask" and each.client == client and each.source in ("", source)
        for each in deeds[i + 1 :]
    )
