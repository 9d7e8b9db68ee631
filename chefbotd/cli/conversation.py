"""A program's conversation with a running daemon: where it is, and what each way of failing is called."""

import asyncio
import os
import signal
import ssl
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from chefbotd.cli.arguments import Address
from chefbotd.cli.exits import Exit, ProgramError
from chefbotd.client import CallError, CallTimeout, Client, ConnectionLost, IncompatibleProtocol

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

    def hold(self, talk: Callable[[Client], Awaitable[T]]) -> T:
        """Connect, ``talk``, disconnect.

        Raises:
            ProgramError: whatever went wrong, with its exit code.
        """
        return self.run(self.connected(talk))

    async def connected(self, talk: Callable[[Client], Awaitable[T]]) -> T:
        """The same, on a loop that runs."""
        try:
            async with Client.connect(
                self.address.host, self.address.port, token=self.trust.token, tls=self.trust.tls
            ) as robot:
                return await talk(robot)
        except CallError as error:
            raise refusal(error) from error
        except (ConnectionLost, CallTimeout) as error:
            raise ProgramError(Exit.CONNECTION_LOST, f"lost the daemon: {error}") from error
        except IncompatibleProtocol as error:
            raise ProgramError(Exit.CANNOT_CONNECT, str(error)) from error
        except (OSError, TimeoutError) as error:
            hint = "is chefbotd running there?"
            raise ProgramError(
                Exit.CANNOT_CONNECT, f"cannot connect to {self.address} ({_why(error)}); {hint}"
            ) from error


def refusal(error: CallError) -> ProgramError:
    """The robot's refusal as the end of a program: the stable kind first, for people and for scripts."""
    return ProgramError(Exit.REFUSED, f"{error.kind}: {error.message}", kind=error.kind)


def _why(error: OSError) -> str:
    if error.errno is not None and error.errno > 0:  # asyncio's own text repeats the address
        return os.strerror(error.errno)
    return error.strerror or str(error) or type(error).__name__
