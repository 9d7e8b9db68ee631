"""A program's conversation with a running daemon: where it is, and what each way of failing is called."""

import asyncio
import os
import signal
import ssl
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, Self, TypeVar

from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import (
    CallError,
    CallTimeout,
    CannotConnect,
    ChefbotError,
    Client,
    ConnectionLost,
    IncompatibleProtocol,
    NoGreeting,
)

T = TypeVar("T")


class Runner(Protocol):
    """Runs a coroutine to its end on an event loop of its own."""

    def __call__(self, main: Coroutine[Any, Any, T], /) -> T:
        """The coroutine's result."""
        ...


def run_until_signalled(main: Coroutine[Any, Any, T]) -> T:
    """Run ``main``; SIGINT, SIGTERM and SIGHUP cancel it, so that its cleanup runs.

    Raises:
        KeyboardInterrupt: it was ended by a signal.
    """

    async def cancellable() -> T:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 - a coroutine that runs is in a task
        for number in (signal.SIGTERM, signal.SIGHUP):
            asyncio.get_running_loop().add_signal_handler(number, task.cancel)
        return await main

    try:
        return asyncio.run(cancellable())
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None


@dataclass(frozen=True, slots=True)
class Trust:
    """What we show the daemon, and whose certificate we believe (None: the connection is not encrypted)."""

    token: str | None = field(default=None, repr=False)
    tls: ssl.SSLContext | None = None


NO_TRUST = Trust()


@dataclass(frozen=True, slots=True)
class Conversation:
    """What every command of chefbotctl needs: where the daemon is, how to print, and an event loop."""

    address: Address
    as_json: bool = False
    run: Runner = run_until_signalled
    trust: Trust = NO_TRUST

    def in_json(self) -> Self:
        """The same, printing JSON."""
        return replace(self, as_json=True)

    def hold(
        self, talk: Callable[[Client], Awaitable[T]], *, name: str | None = None, reconnect: bool = False
    ) -> T:
        """Connect, by our ``name`` if we have one, ``talk``, disconnect; a lost connection may be opened again.

        Raises:
            ProgramError: whatever went wrong, with its exit code.
        """
        return self.run(self.connected(talk, name=name, reconnect=reconnect))

    async def connected(
        self, talk: Callable[[Client], Awaitable[T]], *, name: str | None = None, reconnect: bool = False
    ) -> T:
        """The same, on a loop that runs."""
        try:
            async with AsyncExitStack() as stack:
                return await talk(await self._meet(stack, name, reconnect=reconnect))
        except CallError as error:
            raise refusal(error) from error
        except (ConnectionLost, CallTimeout) as error:
            raise ProgramError(Exit.CONNECTION_LOST, f"lost the daemon: {error}") from error
        except IncompatibleProtocol as error:
            raise ProgramError(Exit.CANNOT_CONNECT, str(error)) from error

    async def _meet(self, stack: AsyncExitStack, name: str | None, *, reconnect: bool) -> Client:
        """Connect, until the stack ends. What fails later, such as printing, is not the connection's failure."""
        where, trust = self.address, self.trust
        meeting = Client.connect(
            where.host, where.port, token=trust.token, tls=trust.tls, name=name, reconnect=reconnect
        )
        try:
            return await stack.enter_async_context(meeting)
        except (CallError, IncompatibleProtocol):
            raise
        except CannotConnect as error:
            told = f"cannot connect to {where} ({_why(error.__cause__)}); is chefbotd running there?"
            raise ProgramError(Exit.CANNOT_CONNECT, told) from error
        except ChefbotError as error:
            silent = isinstance(error, NoGreeting) and trust.tls is None
            advice = "; if it is a chefbotd that speaks TLS, --ca is needed" if silent else ""
            raise ProgramError(Exit.CANNOT_CONNECT, f"cannot connect to {where} ({error}){advice}") from error


ADVICE = {
    "lease_held": "--take-over does so, where a command has it",
    "unauthenticated": "--token-file names a file with one",
}
"""What a refusal means for who types commands."""


def refusal(error: CallError) -> ProgramError:
    """The robot's refusal as the end of a program: the stable kind first, for people and for scripts."""
    advice = f" ({ADVICE[error.kind]})" if error.kind in ADVICE else ""
    return ProgramError(Exit.REFUSED, f"{error.kind}: {error.message}{advice}", kind=error.kind)


def _why(error: BaseException | None) -> str:
    if not isinstance(error, OSError):
        return str(error)
    if isinstance(error, ssl.SSLError):  # its number is not the system's
        return f"TLS: {_why_tls(error)}"
    if error.errno is not None and error.errno > 0:  # asyncio's own text repeats the address
        return os.strerror(error.errno)
    return error.strerror or str(error) or type(error).__name__


def _why_tls(error: ssl.SSLError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return error.verify_message
    return (error.reason or str(error)).lower().replace("_", " ")
