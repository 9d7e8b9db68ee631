"""From a request's line to its answer: parse, look up, check, carry out; every way to fail has an answer."""

from collections import Counter
from collections.abc import Mapping

import structlog
from pydantic import ValidationError

from chefbotd.api import jsonrpc
from chefbotd.api.jsonrpc import ErrorKind, Failure, Request
from chefbotd.api.method import Caller, Method, Unserved
from chefbotd.api.models import Params, explain
from chefbotd.core.commands import Refused

log = structlog.get_logger(__name__)


class Dispatcher:
    """Serves lines; ``faults`` counts, by method, handlers that raised what they should not have."""

    def __init__(self, methods: Mapping[str, Method]) -> None:
        self._methods = methods
        self.faults: Counter[str] = Counter()

    def serve(self, caller: Caller, line: bytes | bytearray) -> None:
        """Carry out one line, and answer it unless it is a notification."""
        request = jsonrpc.parse(line)
        if isinstance(request, Failure):
            caller.reply(jsonrpc.error(request))
            return
        failure = self._carry_out(caller, request)
        if failure is not None and request.wants_answer:
            caller.reply(jsonrpc.error(failure))

    def _carry_out(self, caller: Caller, request: Request) -> Failure | None:
        try:
            method, params = self._prepare(request)
            body = method.handle(caller, params).model_dump_json().encode()
        except Unserved as problem:
            return Failure(problem.kind, str(problem), request.id, problem.details)
        except Refused as refusal:
            return Failure(refusal.kind, str(refusal), request.id)
        except Exception:
            self.faults[request.method] += 1
            log.exception("handler_fault", method=request.method)
            return Failure(ErrorKind.INTERNAL, f"a fault in the daemon during {request.method}", request.id)
        if request.wants_answer:
            caller.reply(jsonrpc.result(request.id, body))
        if method.afterwards is not None:
            method.afterwards(caller, params)
        return None

    def _prepare(self, request: Request) -> tuple[Method, Params]:
        method = self._methods.get(request.method)
        if method is None:
            raise Unserved(ErrorKind.METHOD_NOT_FOUND, f"no method {request.method!a}")
        try:
            return method, method.params.model_validate(request.params)
        except ValidationError as problem:
            message, fields = explain(problem)
            raise Unserved(ErrorKind.INVALID_PARAMS, message, {"fields": fields}) from None
