"""Serves a request from its line to its answer: parse, admit, validate, call; every failure has an answer."""

import re
from collections import Counter
from collections.abc import Callable, Coroutine, Mapping, Sequence
from functools import partial
from inspect import iscoroutinefunction
from typing import Any

import structlog
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.inputs import RequestHandled
from chefbotd.core.printable import find_unprintable
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import inputs_of
from chefbotd.logs import RateLimitedLog
from chefbotd.rpc import jsonrpc, lenient
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.rpc.encoding import encode
from chefbotd.rpc.jobs import Jobs
from chefbotd.rpc.jsonrpc import ERRORS, ErrorKind, Failure, Request
from chefbotd.rpc.method import Caller, Method, Unserved
from chefbotd.rpc.models import MotionParams, Params
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.repeats import RepeatableRequest
from chefbotd.rpc.session import Session


def explain(problem: ValidationError, *, confidential: bool = False) -> tuple[str, list[dict[str, str]]]:
    """A message that names each field, its value (unless confidential) and what was expected, and the same as data."""
    errors = problem.errors(include_url=False, include_context=False)
    fields = [_field_problem(error, confidential=confidential) for error in errors]
    return "; ".join(_sentence(f) for f in fields), fields


def _field_problem(error: ErrorDetails, *, confidential: bool) -> dict[str, str]:
    value = "nothing" if error["type"] == "missing" else _shorten(repr(error["input"]))
    if confidential:
        return {"field": "params", "expected": error["msg"], "got": "what is not repeated here"}
    message = error["msg"].removeprefix("Value error, ")
    expected = "No such parameter" if error["type"] == "extra_forbidden" else message
    return {"field": _path(error["loc"]), "expected": expected, "got": value}


def _sentence(problem: dict[str, str]) -> str:
    return f"{problem['field']}: {problem['expected']}, got {problem['got']}"


def _path(location: Sequence[int | str]) -> str:
    return ".".join(str(step) for step in location) or "params"


def _shorten(text: str) -> str:
    return text if len(text) <= 60 else text[:60] + "..."


log = structlog.get_logger(__name__)

FOREIGN = re.compile(rb"HTTP/[0-9]|\ASSH-|[\x00-\x08\x0e-\x1f]")
"""What no line of JSON that was merely mistyped has in it."""

NOT_JSON = {kind for kind in ERRORS if kind.code == ErrorKind.PARSE_ERROR.code}
WASTED = NOT_JSON | {ErrorKind.INVALID_REQUEST, ErrorKind.RATE_LIMITED}


class Dispatcher:
    """Serves lines; ``faults`` counts, by method, handlers that raised what they should not have.

    ``void`` counts, by the kind of error, commands that came too late; one moves the robot for ``command_timeout_s``.
    ``urgent_pattern`` is found in every line that ``urgent_request`` accepts, however it is escaped.
    ``sheds``: what is more than may wait is refused by ``shed``; else its client is read no further until it is served.
    """

    sheds = False

    def __init__(
        self,
        methods: Mapping[str, Method],
        clock: Clock,
        arrivals: Arrivals,
        command_timeout_s: float,
        jobs: Jobs | None = None,
        stop_number: Callable[[], int] = lambda: 0,
    ) -> None:
        self.jobs = jobs or Jobs()
        self._async_methods = {name for name, m in methods.items() if iscoroutinefunction(m.handle)}
        self._renewable = {name for name, m in methods.items() if m.renew is not None}
        if late := [name for name in self._async_methods if methods[name].urgent]:
            raise ValueError(
                f"{late[0]} is urgent, so its handler must not be async: a stop does not wait for a task"
            )
        self._methods, self._clock = methods, inputs_of(clock)
        self._handled = 0
        self._arrivals, self._command_timeout_s = arrivals, command_timeout_s
        self._stop_number = stop_number
        self.faults: Counter[str] = Counter()
        self.void: Counter[str] = Counter()
        self._limited_log = RateLimitedLog(log)
        self._constants: dict[str, bytes] = {}
        urgent = [
            re.escape(n.encode()) for n, method in methods.items() if method.urgent or method.role is None
        ]
        self.urgent_pattern = re.compile(rb'"(?:%b)"|\\u' % b"|".join(urgent))

    def serve(self, caller: Caller, line: bytes | bytearray, arrival: ByteArrival | None = None) -> None:
        """Carry out one line, and answer it unless it is a notification. Without an ``arrival`` it came just now.

        What moves the robot is not carried out when it came before a stop, or too long ago.
        """
        session = caller.session
        repeated = None if session.repeatable is None else session.repeatable.recognize(line)
        if repeated is not None:
            self.serve_request(caller, repeated, arrival)
            return
        request = self._parse_line(line)
        if isinstance(request, Failure):
            self._refuse(caller, request, wants_answer=True, foreign=_is_foreign(line, request))
            return
        if request.method in self._renewable:
            session.repeatable = RepeatableRequest.of(line, request)
        self.serve_request(caller, request, arrival)

    def serve_request(self, caller: Caller, request: Request, arrival: ByteArrival | None = None) -> None:
        """Carry out a request that was read already, as ``serve`` does."""
        caller.session.record_request()
        failure = self._carry_out(caller, request, arrival)
        if failure is not None:
            self._refuse(caller, failure, wants_answer=request.wants_answer)

    def shed(self, caller: Caller, lines: bytes) -> None:
        """Refuse lines that are more than may wait; none of them is urgent."""
        raise NotImplementedError

    def urgent_request(self, session: Session, line: bytes | bytearray) -> Request | None:
        """The request in a line that is served before others: a stop, or the token that it needs; else None."""
        request = self._parse_line(line)
        method = None if isinstance(request, Failure) else self._methods.get(request.method)
        if isinstance(request, Failure) or method is None:
            return None
        return request if method.urgent or (session.role is None and method.role is None) else None

    def is_foreign(self, line: bytes | bytearray) -> bool:
        """Whether a line is of another protocol."""
        request = self._parse_line(line)
        return isinstance(request, Failure) and _is_foreign(line, request)

    def _parse_line(self, line: bytes | bytearray) -> Request | Failure:
        request = jsonrpc.parse(line)
        return (self._urgent_in(line) or request) if isinstance(request, Failure) else request

    def _urgent_in(self, line: bytes | bytearray) -> Request | None:
        """A request to stop, in a line that was refused for its form."""
        request = lenient.read_leniently(line) if self.urgent_pattern.search(line) is not None else None
        method = self._methods.get(request.method) if request is not None else None
        return request if method is not None and method.urgent else None

    def _refuse(self, caller: Caller, failure: Failure, *, wants_answer: bool, foreign: bool = False) -> None:
        """Say what is wrong, and end a connection that is hopeless: one that has only ever spoken another protocol."""
        session = caller.session
        if failure.kind in WASTED and not session.admit_error(self._clock.now_s()):
            failure = Failure(ErrorKind.FLOODING, f"{failure.message}; this happened too often", failure.id)
        if failure.kind.closes or (foreign and not session.proven):
            caller.end(failure)
        elif wants_answer:
            caller.reply(jsonrpc.error(failure))

    def _carry_out(self, caller: Caller, request: Request, arrival: ByteArrival | None) -> Failure | None:
        answered = False
        try:
            method = self._admit(caller.session, request)
            if method.moves and arrival is not None:
                self._require_fresh(caller.session, request.method, arrival)
            params, is_repeated = _params_of(caller.session, method, request)
            if isinstance(params, MotionParams):
                self._require_unstopped(caller.session, request.method, params)
            self._handled += 1  # also while nothing is recorded: it names the task of a request
            if request.method in self._async_methods:
                handler = partial(method.handle, caller, params)
                with self._clock.entry(partial(self._record, method, caller, params)):
                    in_steps = partial(self._run_job, caller.session, method, self._arrivals.stops)
                    in_steps = partial(in_steps, job_name(self._handled))
                    self.jobs.start(caller, request, handler, self._failure, in_steps)
                return None
            body = self._renew(method, caller, params) if is_repeated else None
            if body is None:
                body = self._constants.get(request.method) or self._handle(method, caller, params)
            if method.constant:
                self._constants[request.method] = body
            if request.wants_answer:
                caller.reply(jsonrpc.result(request.id, body))
            answered = True
            if method.afterwards is not None:
                method.afterwards(caller, params)
        except Exception as problem:  # noqa: BLE001 - told, counted and logged: a handler may raise anything
            failure = self._failure(request, problem)
            return None if answered else failure
        return None

    async def _run_job(
        self,
        session: Session,
        method: Method,
        stops: int,
        job: str,
        run: Callable[[], Coroutine[Any, Any, bytes]],
    ) -> bytes:
        """Run a handler in steps. Its task begins a turn of the loop later: a stop meanwhile makes it void."""
        if method.moves and self._arrivals.stops != stops:
            raise self._void(session, method.name, ErrorKind.OVERTAKEN, self._overtaken())
        return await self._clock.in_steps(job, run, what=method.name)

    def _handle(self, method: Method, caller: Caller, params: Params) -> bytes:
        """The result as JSON. A stop makes older commands of others void, even where it has failed."""
        try:
            with self._clock.entry(partial(self._record, method, caller, params)):
                result = method.handle(caller, params)
            return encode(result)
        finally:
            if method.urgent:
                self._arrivals.record_stop(caller, str(caller.session))

    def _renew(self, method: Method, caller: Caller, params: Params) -> bytes | None:
        """The result of a request that only lets something hold for longer, as JSON. None: it is to be carried out.

        Its record comes when it has succeeded: no event follows from it.
        """
        renew, clock = method.renew, self._clock
        if renew is None:
            return None
        is_outermost = clock.begin()
        try:
            result = renew(caller, params)
            if result is not None and clock.recording and is_outermost:
                clock.publish(self._record(method, caller, params, clock.now_s(), renews=True))
        finally:
            if is_outermost:
                clock.end()
        return None if result is None else encode(result)

    def _record(
        self, method: Method, caller: Caller, params: Params, stamp_s: float, *, renews: bool = False
    ) -> RequestHandled:
        session = caller.session
        recorded_params = (
            None if method.params.confidential else params.model_dump(mode="json", exclude_unset=True)
        )
        return RequestHandled(
            stamp_s,
            self._handled,
            method.name,
            recorded_params,
            session.number,
            session.client,
            session.where,
            session.role,
            renews,
        )

    def _failure(self, request: Request, problem: Exception) -> Failure:
        """The error of a handler's exception; one that is no refusal is a fault, which is counted and logged."""
        if isinstance(problem, Unserved):
            return Failure(problem.kind, str(problem), request.id, problem.data)
        if isinstance(problem, Refused):
            return Failure(problem.kind, str(problem), request.id, problem.data)
        self.faults[request.method] += 1
        log.error("handler_fault", method=request.method, exc_info=problem)
        return Failure(ErrorKind.INTERNAL, f"a fault in the daemon during {request.method}", request.id)

    def _require_fresh(self, session: Session, method: str, arrival: ByteArrival) -> None:
        """Old intent moves nothing: raises ``Unserved`` for what waited long, or came before a stop or in a pause."""
        age_s = self._arrivals.age_s(arrival)
        if self._arrivals.is_before_a_stop(arrival):
            kind, message = ErrorKind.OVERTAKEN, self._overtaken()
        elif age_s > self._command_timeout_s:
            kind = ErrorKind.TOO_OLD
            message = (
                f"the command waited for up to {age_s:.2f} s, longer than the {self._command_timeout_s:g} s for which "
                "a command moves the robot; give it again if it is still wanted"
            )
        elif self._arrivals.is_before_a_pause_ended(arrival):
            kind = ErrorKind.TOO_OLD
            message = (
                "the daemon stood still while the robot drove, and the command may have come before that was over; "
                "give it again if it is still wanted"
            )
        else:
            return
        raise self._void(session, method, kind, message)

    def _require_unstopped(self, session: Session, method: str, params: MotionParams) -> None:
        """Raise ``Unserved`` for what was decided before the last stop or fault, also in another run of the daemon."""
        if params.if_stop_number not in (None, self._stop_number()):
            message = (
                "the robot was stopped, had a fault, or its daemon was started again after this was decided "
                f"(at stop number {params.if_stop_number}); look at the robot, and ask again if it is still wanted"
            )
            raise self._void(session, method, RefusalKind.STOPPED_SINCE, message)

    def _overtaken(self) -> str:
        return Sentence(
            "driving.overtaken",
            "a stop by {stopped_by} came before the command; give it again if it is still wanted",
            stopped_by=self._arrivals.stopped_by,
        )

    def _void(self, session: Session, method: str, kind: ErrorKind | RefusalKind, message: str) -> Unserved:
        """Count and log a command that is not carried out. Returns the error for its client."""
        self.void[kind] += 1
        self._limited_log.warning(
            "command_void", client=str(session), method=method, kind=str(kind), reason=message
        )
        return Unserved(kind, message)

    def _admit(self, session: Session, request: Request) -> Method:
        """The method, if there is one and the client may call it now."""
        method = self._methods.get(request.method)
        if session.role is None and (method is None or method.role is not None):
            raise Unserved(
                ErrorKind.UNAUTHENTICATED, Sentence("socket.no_token", "this robot asks for a token first")
            )
        if session.stops_only and (method is None or not method.when_crowded):
            raise Unserved(
                ErrorKind.TOO_MANY_CLIENTS,
                Sentence(
                    "socket.stops_only",
                    "{why}; this connection is reserved for stop and estop",
                    why=session.stops_only,
                ),
            )
        hurried = method is not None and method.urgent
        if not hurried and not session.admit_request(self._clock.now_s()):
            raise Unserved(ErrorKind.RATE_LIMITED, Sentence("socket.too_often", "too many requests a second"))
        if method is None:
            raise Unserved(
                ErrorKind.METHOD_NOT_FOUND,
                Sentence("socket.no_method", "no method {method!a}", method=request.method),
            )
        if session.role is not None and not method.is_allowed(session.role):
            raise Unserved(ErrorKind.FORBIDDEN, _why_forbidden(request.method, method.role, session.role))
        return method


def _why_forbidden(method: str, needed: Role | None, own: Role) -> Sentence:
    if needed is Role.OBSERVE:
        return Sentence(
            "socket.not_for_guests",
            "{method} is not for guests; this client's is {role}",
            method=method,
            role=str(own),
        )
    return Sentence(
        "socket.role",
        "{method} needs the role {needed}; this client's is {role}",
        method=method,
        needed=str(needed),
        role=str(own),
    )


def job_name(number: int) -> str:
    """What the task of a request is called in a recording."""
    return f"request {number}"


def _is_foreign(line: bytes | bytearray, failure: Failure) -> bool:
    """Whether a refused line is of another protocol: of a browser made to post commands here, of TLS, of noise."""
    if failure.kind is ErrorKind.NOT_UTF8:
        return True
    return failure.kind is ErrorKind.PARSE_ERROR and FOREIGN.search(line) is not None


def _refuse_unprintable(method: Method, params: object) -> None:
    """Others print what a client says. A stop is carried out whatever its reason holds, and makes that printable."""
    text = None if method.urgent else find_unprintable(params)
    if text is not None:
        got = "what is not repeated here" if method.params.confidential else _shorten(ascii(text))
        expected = (
            "expected text without control characters and without characters for the direction of writing"
        )
        problem = {"field": _field_with(text, params), "expected": expected, "got": got}
        raise Unserved(ErrorKind.INVALID_PARAMS, _sentence(problem), {"fields": [problem]})


def _field_with(text: str, params: object) -> str:
    """The parameter that holds an unprintable text, or is it."""
    if isinstance(params, dict):
        for name, value in params.items():
            if find_unprintable(value) == text and find_unprintable(name) is None:
                return str(name)
    return "params"


def _params_of(session: Session, method: Method, request: Request) -> tuple[Params, bool]:
    """The checked parameters, and whether the client has said the same last."""
    last = session.repeatable
    if last is None or last.request.params is not request.params:
        return _check_params(method, request), False
    if last.params is not None:
        return last.params, True
    last.params = _check_params(method, request)
    return last.params, False


def _check_params(method: Method, request: Request) -> Params:
    _refuse_unprintable(method, request.params)
    try:
        return method.params.model_validate(request.params)
    except ValidationError as problem:
        message, fields = explain(problem, confidential=method.params.confidential)
        raise Unserved(ErrorKind.INVALID_PARAMS, message, {"fields": fields}) from None
