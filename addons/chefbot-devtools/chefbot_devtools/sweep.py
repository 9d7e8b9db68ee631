"""Runs jobs on all cores of this computer, or on a dask cluster."""

import contextlib
import os
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from typing import TYPE_CHECKING, Any

from chefbot_devtools.job import Job, Outcome, run_job
from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from distributed import Client

CONNECTS_S = 10.0


def run_local(jobs: list[Job], at_once: int | None, *, quiet: bool) -> list[Outcome]:
    """In the order of the jobs. Ctrl-C ends every run."""
    cancelled = threading.Event()
    pool = ThreadPoolExecutor(at_once or len(os.sched_getaffinity(0)))
    futures = {pool.submit(run_job, job, cancelled.is_set): number for number, job in enumerate(jobs)}
    try:
        return _in_order(
            (futures[done], done.result()) for done in _shown(as_completed(futures), len(jobs), quiet)
        )
    finally:
        cancelled.set()
        pool.shutdown(cancel_futures=True)


def run_on_dask(jobs: list[Job], address: str, *, quiet: bool) -> list[Outcome]:
    """The same on the cluster of this scheduler; each of its workers needs this package.

    Raises:
        ProgramError: the scheduler does not answer, or has no worker.
    """
    import distributed

    try:
        client = distributed.Client(address, timeout=CONNECTS_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise ProgramError(Exit.CANNOT_CONNECT, f"no dask scheduler answers at {address}: {error}") from error
    with client:
        if not client.scheduler_info()["workers"]:
            raise ProgramError(
                Exit.CANNOT_CONNECT, f"the dask scheduler at {address} has no worker: start one first"
            )
        return _run_with(client, jobs, quiet=quiet)


def _run_with(client: "Client", jobs: list[Job], *, quiet: bool) -> list[Outcome]:
    import distributed

    cancelled = distributed.Event(f"chefbot-sweep-{os.urandom(4).hex()}", client=client)
    cancelled.clear()
    futures = client.map(partial(run_in_worker, cancelled_name=cancelled.name), jobs, pure=False)
    numbers = {future.key: number for number, future in enumerate(futures)}
    try:
        finished = _shown(distributed.as_completed(futures), len(jobs), quiet)
        return _in_order((numbers[done.key], _outcome_of(done, jobs[numbers[done.key]])) for done in finished)
    finally:
        with contextlib.suppress(Exception):  # the scheduler may be gone: then there is nobody to tell
            cancelled.set()
            client.cancel(futures)


def run_in_worker(job: Job, cancelled_name: str) -> Outcome:
    """In a worker of the cluster: the run ends with the sweep, and where the scheduler is gone."""
    import distributed

    def is_cancelled() -> bool:
        try:
            return bool(distributed.Event(cancelled_name).is_set())
        except Exception:  # noqa: BLE001 - whatever the connection to a lost scheduler raises
            return True

    return run_job(job, is_cancelled)


def _outcome_of(done: Any, job: Job) -> Outcome:
    """A worker that died with its run is an outcome as well."""
    try:
        outcome: Outcome = done.result()
    except Exception as error:  # noqa: BLE001 - of any kind that the cluster has
        return Outcome(job.world, job.seed, "crashed", f"{type(error).__name__}: {error}", None, 0.0)
    return outcome


def _in_order(numbered: Iterable[tuple[int, Outcome]]) -> list[Outcome]:
    return [outcome for _, outcome in sorted(numbered, key=lambda pair: pair[0])]


def _shown(finished: Iterable[Any], total: int, quiet: bool) -> Iterator[Any]:
    """The same, with a bar of how many there are."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True, quiet=quiet)
    yield from track(finished, "runs", total=total, console=console, disable=quiet)
