"""Long requests: each runs as a task, reports progress, and can be cancelled.

A job ends when its handler does. It is cancelled by the method ``cancel`` and when its client disconnects.
"""

import asyncio
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Final

from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.encoding import encode
from chefbotd.rpc.jsonrpc import ErrorKind, Failure, Request
from chefbotd.rpc.method import Caller, Unserved, method
from chefbotd.rpc.models import Done, Params
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.session import Session

MAX_JOBS: Final = 8
"""Of one client at a time; a job that was cancelled counts until it has ended."""


class CancelParams(Params):
    """The id of the request to cancel."""

    id: str | int | None


class JobProgress(Record, frozen=True):
    """How far a request is: ``done`` of ``total``, in the method's own unit."""

    id: str | int | None
    done: float
    total: float
    text: str


class ProgressReporter:
    """Handed to an async handler, which reports with it how far it is."""

    def __init__(self, caller: Caller, request: Request) -> None:
        self._caller, self._request = caller, request

    def report(self, done: float, total: float, text: str = "") -> None:
        """Send how far the job is; of a client that is behind only the latest report is kept."""
        if self._request.wants_answer:
            model = JobProgress(id=self._request.id, done=done, total=total, text=text)
            self._caller.send_progress(jsonrpc.notification("progress", encode(model)))


Handler = Callable[[ProgressReporter], Coroutine[Any, Any, Any]]
InSteps = Callable[[Callable[[], Coroutine[Any, Any, bytes]]], Coroutine[Any, Any, bytes]]


class Jobs:
    """The jobs of all clients, and the method that cancels one."""

    def __init__(self) -> None:
        self._tasks: dict[Session, dict[object, asyncio.Task[bytes]]] = {}

    def start(
        self,
        caller: Caller,
        request: Request,
        handler: Handler,
        failure_of: Callable[[Request, Exception], Failure],
        in_steps: InSteps = lambda run: run(),
    ) -> None:
        """Run a handler, and answer when it ends; ``failure_of`` makes the error of an exception.

        ``in_steps`` makes the coroutine that becomes the task.

        Raises:
            Unserved: the client has too many jobs, or one with this id.
        """
        own = self._tasks.get(caller.session, {})
        key: object = request.id if request.wants_answer else object()
        if len(own) >= MAX_JOBS:
            raise Unserved(
                ErrorKind.TOO_MANY_JOBS,
                Sentence(
                    "socket.too_many_jobs", "at most {most} requests of a client run at a time", most=MAX_JOBS
                ),
            )
        if key in own:
            raise Unserved(
                ErrorKind.INVALID_REQUEST,
                Sentence(
                    "socket.job_runs", "a request with the id {request!a} is running", request=request.id
                ),
            )
        task = asyncio.get_running_loop().create_task(
            in_steps(partial(_result, handler, ProgressReporter(caller, request)))
        )
        self._tasks.setdefault(caller.session, own)[key] = task

        def finish(task: asyncio.Task[bytes]) -> None:
            self._remove(caller.session, key)
            answer = _answer(task, request, failure_of)
            if request.wants_answer:
                caller.reply(answer, keep=True)

        task.add_done_callback(finish)

    def _remove(self, session: Session, key: object) -> None:
        own = self._tasks[session]
        del own[key]
        if not own:
            del self._tasks[session]

    @method(role=Role.OBSERVE, for_guests=True)
    def cancel(self, caller: Caller, params: CancelParams) -> Done:
        """Cancel a running request of this client. When it has ended, its answer is ``cancelled``."""
        task = self._tasks.get(caller.session, {}).get(params.id)
        if task is None:
            raise Unserved(
                ErrorKind.NO_SUCH_JOB,
                Sentence("socket.no_job", "no request with the id {request!a} is running", request=params.id),
            )
        task.cancel()
        return Done()

    def cancel_all(self, session: Session) -> None:
        """A client is gone: cancel all of its jobs."""
        for task in list(self._tasks.get(session, {}).values()):
            task.cancel()


async def _result(handler: Handler, progress: ProgressReporter) -> bytes:
    return encode(await handler(progress))


def _answer(
    task: asyncio.Task[bytes], request: Request, failure_of: Callable[[Request, Exception], Failure]
) -> bytes:
    if task.cancelled():
        return jsonrpc.error(Failure(ErrorKind.CANCELLED, f"{request.method} was cancelled", request.id))
    problem = task.exception()
    if isinstance(problem, Exception):
        return jsonrpc.error(failure_of(request, problem))
    return jsonrpc.result(request.id, task.result())
