"""The worker's states, and the conditions under which it is killed: pure functions."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence


class WorkerState(StrEnum):
    """How it stands. ``restarting``: it ended, and will be started again; ``unavailable``: it cannot work here."""

    STOPPED = "stopped"
    STARTING = "starting"
    WARMING = "warming"
    READY = "ready"
    RESTARTING = "restarting"
    UNAVAILABLE = "unavailable"


class WorkerTransition(StrEnum):
    """What changes the state."""

    SPAWNED = "spawned"
    WARMING = "warming"
    READY = "ready"
    ENDED = "ended"
    UNAVAILABLE = "unavailable"
    STOPPED = "stopped"


LIVING: Final = (WorkerState.STARTING, WorkerState.WARMING, WorkerState.READY)

NEXT: Final[Mapping[tuple[WorkerState, WorkerTransition], WorkerState]] = {
    (WorkerState.STOPPED, WorkerTransition.SPAWNED): WorkerState.STARTING,
    (WorkerState.RESTARTING, WorkerTransition.SPAWNED): WorkerState.STARTING,
    (WorkerState.STARTING, WorkerTransition.WARMING): WorkerState.WARMING,
    (WorkerState.WARMING, WorkerTransition.WARMING): WorkerState.WARMING,
    (WorkerState.STARTING, WorkerTransition.READY): WorkerState.READY,
    (WorkerState.WARMING, WorkerTransition.READY): WorkerState.READY,
    (WorkerState.STARTING, WorkerTransition.UNAVAILABLE): WorkerState.UNAVAILABLE,
    (WorkerState.WARMING, WorkerTransition.UNAVAILABLE): WorkerState.UNAVAILABLE,
    (WorkerState.STOPPED, WorkerTransition.ENDED): WorkerState.RESTARTING,
    (WorkerState.RESTARTING, WorkerTransition.ENDED): WorkerState.RESTARTING,
    **{(state, WorkerTransition.ENDED): WorkerState.RESTARTING for state in LIVING},
    **{(state, WorkerTransition.STOPPED): WorkerState.STOPPED for state in WorkerState},
}
"""What is not here cannot happen with a worker of ours: one that says so is not believed, and is killed."""

MOST_MESSAGES_A_SECOND: Final = 1000
"""Ours sends some 50. A flood would take time from the control loop."""

FIRST_WORD_S: Final = 20.0
"""Python's own start, on a small board that is just booting."""

LEAST_SHARE: Final = 0.01
"""Of one processor: a worker that loads or compiles has more of it even beside many busy programs; one that waits for
ever, less."""


class Vitals(Record, frozen=True):
    """What is known of a living worker; all times are the daemon's.

    ``busy_s`` is how long it had been at its present work by its last message, ``allowed_s`` how long it may be.
    ``messages`` counts those since the last check. ``cpu_s`` is the processor time that it has used (None: nobody
    knows), and ``worked_s`` when that last grew.
    """

    spawned_s: float
    heard_s: float
    checked_s: float
    cpu_s: float | None = None
    worked_s: float = 0.0
    busy_s: float = 0.0
    doing: str = ""
    messages: int = 0


def check_vitals(vitals: Vitals, now_s: float) -> Vitals:
    """The vitals after a check."""
    return replace(vitals, checked_s=now_s, messages=0)


def note_work(vitals: Vitals, cpu_s: float | None, now_s: float) -> Vitals:
    """The vitals once its processor time has been read."""
    grows = cpu_s is not None and (vitals.cpu_s is None or cpu_s > vitals.cpu_s)
    return replace(vitals, cpu_s=cpu_s, worked_s=now_s if grows else vitals.worked_s)


def excuse_lateness(vitals: Vitals, now_s: float, period_s: float) -> Vitals:
    """The vitals where this check comes late: what the daemon slept through is not the worker's silence."""
    late_s = now_s - vitals.checked_s - period_s
    if late_s <= period_s:
        return vitals
    return replace(vitals, spawned_s=vitals.spawned_s + late_s, heard_s=vitals.heard_s + late_s)


def was_too_slow(reason: str) -> bool:
    """Whether the worker was ended because it did not answer in time."""
    return "did not answer" in reason


def took_too_much(reason: str) -> bool:
    """Whether the worker was killed for its memory, by the reason that ``why_to_kill`` gave."""
    return "MB of memory;" in reason


def why_to_kill(
    parameters: WorkerParameters,
    state: WorkerState,
    vitals: Vitals,
    now_s: float,
    *,
    rss_mb: float | None,
    allowed_s: float,
) -> str | None:
    """Which bound the worker breaks, in words, or None; ``allowed_s`` is what its present work may take."""
    starting = state in (WorkerState.STARTING, WorkerState.WARMING)
    if rss_mb is not None and rss_mb > parameters.max_memory_mb:
        return Sentence(
            "worker.took_memory",
            "it took {rss_mb:.0f} MB of memory; {most_mb:g} MB are allowed",
            rss_mb=rss_mb,
            most_mb=parameters.max_memory_mb,
        )
    if starting and _starts_too_long(vitals, now_s - vitals.spawned_s, parameters.start_timeout_s):
        return Sentence(
            "worker.not_ready_in_time",
            "it was not ready within {seconds:g} s",
            seconds=parameters.start_timeout_s,
        )
    heard_s = max(vitals.heard_s, vitals.worked_s) if starting else vitals.heard_s
    silent_s, most_s = now_s - heard_s, parameters.silence_timeout_s
    if silent_s > (max(FIRST_WORD_S, most_s) if state is WorkerState.STARTING else most_s):
        return Sentence(
            "worker.silent",
            "it was silent for {silent_s:.1f} s ({most_s:g} s are allowed)",
            silent_s=silent_s,
            most_s=most_s,
        )
    if not starting and vitals.busy_s > allowed_s:
        return Sentence(
            "worker.busy",
            "it was busy with {doing} for {busy_s:.1f} s, {allowed_s:g} s are allowed",
            doing=vitals.doing or "something",
            busy_s=vitals.busy_s,
            allowed_s=allowed_s,
        )
    passed_s = max(now_s - vitals.checked_s, 1e-3)
    if vitals.messages > MOST_MESSAGES_A_SECOND * max(passed_s, 1.0):
        return Sentence(
            "worker.floods",
            "it sent {messages} messages within {passed_s:.1f} s",
            messages=vitals.messages,
            passed_s=passed_s,
        )
    return None


def _starts_too_long(vitals: Vitals, passed_s: float, most_s: float) -> bool:
    """Counted in its own processor time, as others may have the computer; one that hardly uses any is hung."""
    if vitals.cpu_s is None:
        return passed_s > most_s
    return vitals.cpu_s > most_s or (passed_s > most_s and vitals.cpu_s < LEAST_SHARE * passed_s)


def backoff_s(parameters: WorkerParameters, failures: int) -> float:
    """How long to wait after so many failures in a row (1: the first)."""
    return float(
        min(parameters.restart_delay_s * 2 ** (min(failures, 32) - 1), parameters.max_restart_delay_s)
    )
