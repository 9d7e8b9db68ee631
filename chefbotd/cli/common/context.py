"""Shared parts of chefbotctl's commands: the daemon's address, the event loop, and exit codes for failures."""

import asyncio
import os
import signal
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager
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
    MotionInterrupted,
    NoGreeting,
)
from chefbotd.core.record import Record, replace

T = TypeVar("T")


class CoroutineRunner(Protocol):
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


@asynccontextmanager
async def beside(*loops: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    """Run these while the block runs."""
    tasks = [asyncio.create_task(loop) for loop in loops]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)


class Credentials(Record, frozen=True):
    """The token for the daemon, and the TLS context that verifies its certificate (None: not encrypted).

    ``clear_token``: it may go to another computer without TLS.
    """

    token: str | None = None
    tls: ssl.SSLContext | None = None
    clear_token: bool = False

    def __repr__(self) -> str:
        """Without the token."""
        return f"Credentials(encrypted={self.tls is not None})"


NO_CREDENTIALS = Credentials()


class CommandContext(Record, frozen=True):
    """Where the daemon is, whether to print JSON, how to run an event loop, and the credentials."""

    address: Address
    as_json: bool = False
    run: CoroutineRunner = run_until_signalled
    credentials: Credentials = NO_CREDENTIALS

    def in_json(self) -> Self:
        """A copy that prints JSON."""
        return replace(self, as_json=True)

    def run_with_client(
        self,
        action: Callable[[Client], Awaitable[T]],
        *,
        name: str | None = None,
        reconnect: bool = False,
        absent: str = "",
    ) -> T:
        """Run ``action`` with a connected client called ``name``; ``reconnect`` opens a lost connection again.

        ``absent`` says why a daemon may not have the methods and topics that are asked for.

        Raises:
            ProgramError: any failure, with its exit code.
        """
        return self.run(self.with_client(action, name=name, reconnect=reconnect, absent=absent))

    async def with_client(
        self,
        action: Callable[[Client], Awaitable[T]],
        *,
        name: str | None = None,
        reconnect: bool = False,
        absent: str = "",
    ) -> T:
        """As ``run_with_client``, on the running loop."""
        try:
            async with AsyncExitStack() as stack:
                return await action(await self._connect(stack, name, reconnect=reconnect))
        except CallError as error:
            raise refusal(error, absent) from error
        except (ConnectionLost, CallTimeout) as error:
            raise ProgramError(Exit.CONNECTION_LOST, f"lost the daemon: {error}") from error
        except MotionInterrupted as error:
            raise ProgramError(Exit.NOT_DONE, str(error)) from error
        except IncompatibleProtocol as error:
            raise ProgramError(Exit.CANNOT_CONNECT, str(error)) from error

    async def _connect(self, stack: AsyncExitStack, name: str | None, *, reconnect: bool) -> Client:
        """Connect until the stack ends. Only failures to connect are reported as such, not those of a later action."""
        where, credentials = self.address, self.credentials
        connection = Client.connect(
            where.host,
            where.port,
            token=credentials.token,
            tls=credentials.tls,
            name=name,
            reconnect=reconnect,
            clear_token=credentials.clear_token,
        )
        try:
            return await stack.enter_async_context(connection)
        except (CallError, IncompatibleProtocol):
            raise
        except CannotConnect as error:
            message = f"cannot connect to {where} ({_reason(error.__cause__)}); {_advice(error.__cause__)}"
            raise ProgramError(Exit.CANNOT_CONNECT, message) from error
        except ChefbotError as error:
            may_need_tls = isinstance(error, NoGreeting) and credentials.tls is None
            advice = "; if it is a chefbotd that speaks TLS, --ca is needed" if may_need_tls else ""
            raise ProgramError(Exit.CANNOT_CONNECT, f"cannot connect to {where} ({error}){advice}") from error


ADVICE = {
    "lease_held": "--take-over does so, where a command has it",
    "unauthenticated": "--token-file names a file with one",
}
"""What a user can do after each kind of refusal."""

NOT_THERE = ("method_not_found", "unknown_topic")


def refusal(error: CallError, absent: str = "") -> ProgramError:
    """The daemon's refusal as a program error; the message starts with the stable kind.

    ``absent`` says why a daemon may lack what was asked for.
    """
    if absent and error.kind in NOT_THERE:
        return ProgramError(Exit.REFUSED, f"{error.kind}: {absent}", kind=error.kind)
    advice = f" ({ADVICE[error.kind]})" if error.kind in ADVICE else ""
    return ProgramError(Exit.REFUSED, f"{error.kind}: {error.message}{advice}", kind=error.kind)


def _reason(error: BaseException | None) -> str:
    if not isinstance(error, OSError):
        return str(error)
    if isinstance(error, ssl.SSLError):  # its number is not an errno
        return f"TLS: {_tls_reason(error)}"
    if error.errno is not None and error.errno > 0:  # asyncio's own text repeats the address
        return os.strerror(error.errno)
    return error.strerror or str(error) or type(error).__name__


WRONG_NAME = (62, 64)
"""OpenSSL's X509_V_ERR_HOSTNAME_MISMATCH and X509_V_ERR_IP_ADDRESS_MISMATCH (x509_vfy.h)."""


def _advice(error: BaseException | None) -> str:
    """What to look at: a program that has shown a certificate is running."""
    if isinstance(error, ssl.SSLCertVerificationError):
        if error.verify_code in WRONG_NAME:
            return "call it by a name or an address that is in its certificate"
        return "--ca has to name the daemon's own certificate, or that of the authority which signed it"
    if isinstance(error, ssl.SSLError):
        return "if it is a chefbotd without TLS, leave --ca out"
    return "is chefbotd running there?"


def _tls_reason(error: ssl.SSLError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return error.verify_message.rstrip(".")
    return (error.reason or str(error)).lower().replace("_", " ")
