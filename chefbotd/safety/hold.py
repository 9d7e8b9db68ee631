"""The sources of commands that a stop holds, and for whom.

A driver that repeats its command without knowing of a stop would undo the stop 50 ms later. So a stop holds every
source that another client has lately tried to drive. An emergency stop or a fault also holds the sources that its own
client has tried, and those that anybody tries while it is latched. A try is any command that names the source, carried
out or not.

Only clients that know of the stop may drive a held source. These are the client that sent the stop, unless it was held
itself, and clients that asked to drive after the stop. All other clients are held, because each may be the same driver
on a new connection. A source is free when no held client has tried it for ``stop_hold_s``. Commands of clients that
know of the stop do not change this time.

Taking control of a source is a try, too. For another client it is also a request to drive after the stop, under two
conditions: the client has not tried the source within ``stop_hold_s``, and nobody has taken control of it within
``TAKING_PAUSE_S``. So a program that repeats the request ends no stop, on one connection or on a new one each time.
"""

from chefbotd.core.record import Record, replace

NEVER_S = float("-inf")
MOST_KNOWING = MOST_TRYING = 64
"""So many clients that know of a stop, or that try, are remembered, the latest ones; who is forgotten asks again."""

TAKING_PAUSE_S = 5.0
"""Who takes control so soon after anybody has taken it may be a program that repeats it (assumed)."""


class DriveAttempts(Record, frozen=True, array_like=True):
    """The last try to drive a source and its client, the last one of any other client, and the stop that holds it.

    ``stopped_by`` is empty where none does. ``knowing`` are the clients that are not held, and ``held_s`` is when a
    held one has tried last. ``trying`` has the last try of each client that has tried lately, ``taken_s`` is when
    anybody has taken control of the source last.
    """

    source: str
    client: int
    stamp_s: float
    others_s: float = NEVER_S
    stopped_by: str = ""
    knowing: tuple[int, ...] = ()
    held_s: float = NEVER_S
    trying: tuple[tuple[int, float], ...] = ()
    taken_s: float = NEVER_S


State = tuple[DriveAttempts, ...]
"""One for each source that anybody has ever tried to drive."""


def record_attempt(
    state: State, source: str, client: int, now_s: float, stop_hold_s: float, latched_by: str = ""
) -> State:
    """A client tries to drive a source. ``latched_by`` is not empty while an emergency stop or a fault is latched."""
    before, other_sources = None, []
    for tries in state:
        if tries.source == source:
            before = tries
        else:
            other_sources.append(tries)
    if before is None:
        before = DriveAttempts(source, client, NEVER_S)
    others_s = before.others_s if before.client == client else before.stamp_s
    stopped_by, knowing, held_s = before.stopped_by, before.knowing, before.held_s
    if now_s - held_s >= stop_hold_s:
        stopped_by, knowing = "", ()
    if latched_by:
        stopped_by, knowing = latched_by, ()
    if stopped_by and client not in knowing:
        held_s = now_s
    others: list[tuple[int, float]] = []
    if others_s > NEVER_S:
        others = [o for o in before.trying if o[0] != client and now_s - o[1] < stop_hold_s][
            1 - MOST_TRYING :
        ]
    trying = (*others, (client, now_s))
    after = DriveAttempts(
        source, client, now_s, others_s, stopped_by, knowing, held_s, trying, before.taken_s
    )
    return (*other_sources, after)


def stop(state: State, client: int, by: str, now_s: float, stop_hold_s: float) -> State:
    """A client stops the robot: hold what others have tried to drive lately. ``by`` is the client's name."""
    return tuple([_note_stop(tries, client, by, now_s, stop_hold_s) for tries in state])


def latch(state: State, by: str, now_s: float, stop_hold_s: float) -> State:
    """An emergency stop or a fault: hold what anybody has tried to drive lately."""
    return tuple(
        [
            replace(tries, stopped_by=by, knowing=(), held_s=tries.stamp_s)
            if now_s - tries.stamp_s < stop_hold_s
            else tries
            for tries in state
        ]
    )


def acknowledge(state: State, client: int, source: str | None = None) -> State:
    """A client that knows of every stop so far asks to drive this source (None: any): it is held no longer."""
    return tuple(
        [
            replace(tries, knowing=(*tries.knowing, client)[-MOST_KNOWING:])
            if tries.stopped_by and client not in tries.knowing and source in (None, tries.source)
            else tries
            for tries in state
        ]
    )


def take_over(
    state: State,
    source: str,
    client: int,
    now_s: float,
    stop_hold_s: float,
    latched_by: str,
    *,
    from_another: bool,
) -> State:
    """A client takes control of a source, perhaps from another one; what is taken during a latch counts for nothing."""
    before = _of(state, source)
    is_repeated = before is not None and (
        now_s - before.taken_s < TAKING_PAUSE_S
        or any(other == client and now_s - at_s < stop_hold_s for other, at_s in before.trying)
    )
    if from_another and not is_repeated:
        state = acknowledge(state, client, source)
    *others, tries = record_attempt(state, source, client, now_s, stop_hold_s, latched_by)
    return (*others, replace(tries, taken_s=now_s))


def holder_of(state: State, source: str, client: int) -> str:
    """Whose stop holds a client that has just tried to drive a source; empty where none does."""
    tries = _of(state, source)
    return "" if tries is None or client in tries.knowing else tries.stopped_by


def _note_stop(tries: DriveAttempts, client: int, by: str, now_s: float, stop_hold_s: float) -> DriveAttempts:
    was_held = bool(tries.stopped_by) and client not in tries.knowing and now_s - tries.held_s < stop_hold_s
    others_s = tries.others_s if tries.client == client else tries.stamp_s
    if now_s - others_s >= stop_hold_s:
        return tries
    held_s = tries.stamp_s if was_held else max(tries.held_s, others_s)
    return replace(tries, stopped_by=by, knowing=() if was_held else (client,), held_s=held_s)


def _of(state: State, source: str) -> DriveAttempts | None:
    for tries in state:
        if tries.source == source:
            return tries
    return None
