"""When a worker is killed, and how its state goes on: tables, without a process."""

from itertools import product

import pytest

from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.watch import (
    NEXT,
    Vitals,
    WorkerState,
    WorkerTransition,
    backoff_s,
    check_vitals,
    excuse_lateness,
    note_work,
    why_to_kill,
)
from chefbotd.core.record import replace

S, H = WorkerState, WorkerTransition
PARAMETERS = WorkerParameters(start_timeout_s=60, silence_timeout_s=3, step_timeout_s=20, max_memory_mb=400)
GOOD = Vitals(spawned_s=90.0, heard_s=99.7, checked_s=99.9)


def why(
    state: WorkerState = S.READY, rss_mb: float | None = 150.0, allowed_s: float = 20.0, **vitals: object
) -> str:
    """The reason at second 100, empty where there is none."""
    changed = replace(GOOD, **vitals)  # type: ignore[arg-type]
    return why_to_kill(PARAMETERS, state, changed, 100.0, rss_mb=rss_mb, allowed_s=allowed_s) or ""


def test_every_pair_of_state_and_event_is_decided() -> None:
    """What can happen in which state is written down here; all other pairs are a worker that is not to be believed."""
    living = [S.STARTING, S.WARMING, S.READY]
    expected = {
        **{(state, H.SPAWNED): S.STARTING for state in (S.STOPPED, S.RESTARTING)},
        **{(state, H.WARMING): S.WARMING for state in (S.STARTING, S.WARMING)},
        **{(state, H.READY): S.READY for state in (S.STARTING, S.WARMING)},
        **{(state, H.UNAVAILABLE): S.UNAVAILABLE for state in (S.STARTING, S.WARMING)},
        **{(state, H.ENDED): S.RESTARTING for state in (*living, S.STOPPED, S.RESTARTING)},
        **{(state, H.STOPPED): S.STOPPED for state in S},
    }
    assert {pair: NEXT[pair] for pair in product(S, H) if pair in NEXT} == expected


def test_a_healthy_worker_lives() -> None:
    """Nothing is wrong in any state with what a healthy worker shows, also where memory cannot be read."""
    assert [why(state) for state in (S.STARTING, S.WARMING, S.READY)] == ["", "", ""]
    assert why(rss_mb=None) == ""


@pytest.mark.parametrize(
    ("state", "heard_s", "killed"),
    [
        (S.READY, 97.1, False),
        (S.READY, 96.9, True),
        (S.WARMING, 96.9, True),
        (S.STARTING, 96.9, False),
        (S.STARTING, 79.9, True),
    ],
)
def test_silence_is_measured(state: WorkerState, heard_s: float, killed: bool) -> None:
    """After 3 s without a word it is taken for hung; Python's own start may take 20 s."""
    assert ("silent" in why(state, heard_s=heard_s, spawned_s=79.0)) is killed


def test_a_start_has_its_end() -> None:
    """A worker that never becomes ready is killed after start_timeout_s; one that is ready may be as old as it likes."""
    assert "within 60 s" in why(S.WARMING, spawned_s=39.9)
    assert why(S.READY, spawned_s=-1e6) == ""


@pytest.mark.parametrize(
    ("cpu_s", "killed"),
    [(3.5, False), (60.0, False), (60.1, True), (0.9, True)],
    ids=["it has a thirtieth of a processor", "all that is allowed", "more than that", "it hangs"],
)
def test_a_start_beside_other_programs_takes_as_long_as_it_takes(cpu_s: float, killed: bool) -> None:
    """100 s after the start: what counts is how long it has worked itself, and that it works at all."""
    assert ("within 60 s" in why(S.WARMING, spawned_s=0.0, cpu_s=cpu_s)) is killed


@pytest.mark.parametrize(("state", "killed"), [(S.STARTING, False), (S.WARMING, False), (S.READY, True)])
def test_a_worker_that_compiles_may_be_silent(state: WorkerState, killed: bool) -> None:
    """The compiler lets no other thread say a word; one that is ready and silent for 22 s is hung all the same."""
    assert ("silent" in why(state, heard_s=78.0, spawned_s=77.0, cpu_s=5.0, worked_s=99.0)) is killed


def test_processor_time_that_grows_is_a_sign_of_life() -> None:
    """The first reading is one as well; where it cannot be read there is none."""
    first = note_work(GOOD, 1.0, 100.0)
    assert (first.cpu_s, first.worked_s) == (1.0, 100.0)
    assert note_work(first, 1.0, 101.0).worked_s == 100.0
    assert note_work(first, 1.01, 101.0).worked_s == 101.0
    assert (note_work(first, None, 101.0).cpu_s, note_work(first, None, 101.0).worked_s) == (None, 100.0)


def test_work_has_a_deadline() -> None:
    """One that lives but is at the same step for too long is killed, and the reason says at what it was."""
    assert why(busy_s=19.9, doing="mapping: a scan") == ""
    assert (
        why(busy_s=20.1, doing="mapping: a scan")
        == "it was busy with mapping: a scan for 20.1 s, 20 s are allowed"
    )
    assert why(S.WARMING, busy_s=50.0) == "", "compiling has its own bound"
    assert why(busy_s=50.0, allowed_s=60.0) == ""


def test_memory_is_bounded() -> None:
    """Too much resident memory is a reason in every state, with both figures."""
    for state in (S.STARTING, S.WARMING, S.READY):
        assert why(state, rss_mb=401.0) == "it took 401 MB of memory; 400 MB are allowed"
    assert why(rss_mb=399.0) == ""


def test_a_flood_is_a_reason() -> None:
    """More than a thousand messages in a second are not ours."""
    assert why(messages=1001) == "it sent 1001 messages within 0.1 s"
    assert why(messages=999) == ""
    assert check_vitals(replace(GOOD, messages=999), 100.0).messages == 0


def test_what_the_daemon_slept_through_is_no_silence() -> None:
    """A daemon that was stopped for 10 s does not kill a worker that it could not hear meanwhile."""
    asleep = Vitals(spawned_s=50.0, heard_s=89.7, checked_s=90.0)
    awake = excuse_lateness(asleep, 100.25, 0.25)
    assert awake.heard_s == pytest.approx(99.7)
    assert awake.spawned_s == pytest.approx(60.0)
    assert excuse_lateness(asleep, 90.3, 0.25) == asleep, "a check on time excuses nothing"


def test_the_wait_doubles_up_to_its_bound() -> None:
    """0.5 s after a first failure, then 1, 2, 4 and at most 30."""
    parameters = WorkerParameters(restart_delay_s=0.5, max_restart_delay_s=30)
    assert [backoff_s(parameters, n) for n in (1, 2, 3, 4, 7, 100)] == [0.5, 1, 2, 4, 30, 30]
