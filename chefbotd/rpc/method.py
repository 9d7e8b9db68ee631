"""A method of the socket: one function, with its parameters, its result, its role and its purpose beside it."""

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from chefbotd.core.commands import RefusalKind
from chefbotd.core.record import Record
from chefbotd.core.sentence import sentence_data
from chefbotd.rpc.encoding import Sent, UnknownData
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.models import Params
from chefbotd.rpc.parameters import Role

if TYPE_CHECKING:
    from chefbotd.rpc.encoding import EventPayload
    from chefbotd.rpc.session import Session

F = TypeVar("F", bound=Callable[..., Any])


class EventSink(Protocol):
    """Where events for one client go."""

    def __call__(self, payload: "EventPayload", latest: bool) -> None:
        """Send an event, or keep it by the policy while the client is behind; never waits."""
        ...


class Receiver(Protocol):
    """A client that takes events."""

    @property
    def send_event(self) -> EventSink:
        """The same function each time: who sends many events asks once."""
        ...


class Caller(Receiver, Protocol):
    """The client behind a request; ``session`` says who it is and what it may."""

    session: "Session"

    def reply(self, message: bytes, *, keep: bool = False) -> None:
        """Send an answer; never waits. ``keep``: even if the client reads too little and the answer has no room."""
        ...

    def send_progress(self, message: bytes) -> None:
        """Send a progress notification, or keep the latest while the client is behind; never waits."""
        ...

    def end(self, failure: Failure) -> None:
        """Send this error, and close the connection."""
        ...


class Unserved(Exception):
    """A well-formed request that the socket itself cannot carry out."""

    def __init__(
        self, kind: ErrorKind | RefusalKind, message: str, details: Mapping[str, object] | None = None
    ) -> None:
        super().__init__(message)
        self.kind, self.words, self.details = kind, message, details or {}

    @property
    def data(self) -> dict[str, object]:
        """What the error says beside its kind and its words."""
        return {**sentence_data(self.words), **self.details}


class Method(Struct, frozen=True):
    """``handle`` takes the caller and checked parameters; ``afterwards`` runs when the answer is on its way.

    ``renew`` takes the same as ``handle`` where a client says again what it said last. It returns the result, or None
    where it has changed nothing, and ``handle`` is to be called.

    A coroutine function also takes a ``Progress``. It runs as a job, and the request is answered when it ends.

    ``role`` is what a client needs for it, None: not even a token. An ``urgent`` method stops the robot: it passes
    every rate limit, is never refused for its form, and may overtake others. One that ``moves`` the robot, or lets it
    move, is not carried out when it was overtaken. One that is served ``when_crowded`` can also be called from a place
    kept for stops. A ``constant`` one always answers the same. Of what an observer may call, guests may call what is
    ``for_guests``.
    """

    role: Role | None
    params: type[Params]
    result: type[Sent]
    handle: Callable[..., Any]
    afterwards: Callable[[Caller, Any], None] | None = None
    urgent: bool = False
    moves: bool = False
    when_crowded: bool = False
    constant: bool = False
    for_guests: bool = False
    renew: Callable[[Caller, Any], Any] | None = None

    def is_allowed(self, role: Role) -> bool:
        """Whether a client of this role may call it."""
        if role is Role.GUEST and self.role is Role.OBSERVE:
            return self.for_guests
        return self.role is None or role.allows(self.role)

    @property
    def name(self) -> str:
        """The handler's own name."""
        return self.handle.__name__

    @property
    def summary(self) -> str:
        """The handler's own first line."""
        return (self.handle.__doc__ or "").partition("\n")[0]


def method(
    *,
    role: Role | None,
    urgent: bool = False,
    moves: bool | None = None,
    when_crowded: bool = False,
    constant: bool = False,
    for_guests: bool = False,
    afterwards: Callable[[Any, Caller, Any], None] | None = None,
    params: type[Params] | None = None,
    renew: Callable[[Any, Caller, Any], Any] | None = None,
) -> Callable[[F], F]:
    """Make ``def name(self, caller: Caller, params: SomeParams) -> SomeResult`` the method ``name`` of the socket.

    The handler runs in the call that delivered the request's bytes: a stop reaches the wire in one call stack. It
    raises ``chefbotd.core.commands.Refused`` for what the robot does not do. The flags are those of ``Method``;
    ``params`` is a model made at run time, which no annotation can name. A method that not every observer may call says
    whether it ``moves`` the robot: a stop voids what was sent before it only of those that do.
    """
    for_observers = role in (None, Role.OBSERVE)

    def mark(function: F) -> F:
        if for_observers and moves:
            raise TypeError(f"{function.__qualname__} moves the robot, so observers must not have it")
        if moves is None and not for_observers:
            raise TypeError(
                f"{function.__qualname__} must say whether it moves the robot: moves=True or moves=False"
            )
        signature = inspect.signature(function)
        _require_arguments(function, signature)
        params_model, result = (
            params or signature.parameters["params"].annotation,
            signature.return_annotation,
        )
        for what, model, bases in (
            ("params", params_model, (Params,)),
            ("its result", result, (Record, UnknownData)),
        ):
            if not (isinstance(model, type) and issubclass(model, bases)):
                expected = bases[0].__name__
                raise TypeError(
                    f"{function.__qualname__}: {what} must be annotated with a {expected}, got {model!r}"
                )
        after: Any = afterwards  # both are bound to the handlers by ``methods_of``
        again: Any = renew
        row = Method(
            role,
            params_model,
            result,
            function,
            after,
            urgent,
            bool(moves),
            when_crowded,
            constant,
            for_guests,
            again,
        )
        function._method = row  # type: ignore[attr-defined]
        return function

    return mark


def _require_arguments(function: Callable[..., Any], signature: inspect.Signature) -> None:
    """Raise ``TypeError`` unless the handler can be called with what a request of its kind brings."""
    names = ["self", "caller", "params"]
    if inspect.iscoroutinefunction(function):
        names.append("progress")
    try:
        signature.bind(*names)
    except TypeError as error:
        kind = "async def" if "progress" in names else "def"
        expected = f"{kind} {function.__name__}({', '.join(names)})"
        raise TypeError(
            f"{function.__qualname__}: expected {expected}, got {kind} {function.__name__}{signature}"
        ) from error


def methods_of(handlers: object) -> tuple[Method, ...]:
    """The methods of an object, in the order of its class."""
    rows: Iterable[tuple[str, Method]] = (
        (name, function._method)
        for name, function in vars(type(handlers)).items()
        if hasattr(function, "_method")
    )
    return tuple(
        replace(
            row,
            handle=getattr(handlers, name),
            afterwards=None if row.afterwards is None else row.afterwards.__get__(handlers),
            renew=None if row.renew is None else row.renew.__get__(handlers),
        )
        for name, row in rows
    )
