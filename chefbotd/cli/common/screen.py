"""The base of chefbotctl's screens: background tasks, a message line, and the error that ended the screen."""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from typing import Any, ClassVar

from rich.text import Text
from textual.app import App
from textual.widgets import Static

from chefbotd.client import CallError, CallTimeout, ChefbotError, Client, ConnectionLost
from chefbotd.core.printable import one_line

MAYBE_NOT_RECEIVED = "The connection is lost: the daemon may not have got this."


class RobotScreen(App[None]):
    """A screen for one robot; ``failure`` is the error that ended it, None when the user did."""

    ENABLE_COMMAND_PALETTE = False
    BASE_CSS: ClassVar[str] = """
    #title { background: $primary; color: $text; height: 1; padding: 0 1; text-style: bold; }
    #message { height: 1; padding: 0 1; color: $warning; dock: bottom; }
    """

    def __init__(self, robot: Client, address: str, *, reconnects: bool = False) -> None:
        """``reconnects``: the client opens a lost connection again, and the screen waits for it."""
        super().__init__()
        self.reconnects = reconnects
        self.robot, self.heading = robot, one_line(f"{robot.hello.robot} at {address}")
        self.failure: ChefbotError | None = None
        self._background_tasks: list[asyncio.Task[None]] = []

    async def show(self) -> None:
        """Show the screen until the user quits; raises the client error that ended it, if any."""
        await self.run_async(mouse=False)
        if self.failure is not None:
            raise self.failure

    def run_tasks(self, *coroutines: Coroutine[Any, Any, None]) -> None:
        """Run these until the screen ends. A client error in one of them ends the screen."""
        self._background_tasks += [asyncio.create_task(self._guarded(task)) for task in coroutines]

    async def _guarded(self, task: Coroutine[Any, Any, None]) -> None:
        try:
            await task
        except ChefbotError as failure:
            self._fail(failure)

    async def on_unmount(self) -> None:
        """Textual: the screen ends. Cancel the tasks and wait for their cleanup."""
        for task in self._background_tasks:
            task.cancel()
        await asyncio.gather(*self._background_tasks, return_exceptions=True)

    async def action_leave(self) -> None:
        """Textual: a key that quits."""
        self.exit()

    async def wait_for_connection(self, loss: ConnectionLost) -> None:
        """Wait after a ``ConnectionLost`` until connected again; raises it if the client does not reconnect."""
        if not self.reconnects:
            raise loss
        while True:
            with contextlib.suppress(CallTimeout):
                return await self.robot.wait_until_connected()

    async def ask(self, request: Coroutine[Any, Any, object], done: str) -> bool:
        """Send a request and show that it is done, or why it was refused; returns whether it is done."""
        is_done = False
        try:
            await request
            is_done = True
        except CallError as error:
            done = f"{error.kind}: {error.message}"
        except ConnectionLost as loss:
            done = MAYBE_NOT_RECEIVED
            if not self.reconnects:
                self._fail(loss)
        except ChefbotError as failure:
            self._fail(failure)
        self.say(done)
        return is_done

    def say(self, text: str) -> None:
        """Show a text on the message line."""
        if self.is_running:
            self.query_one("#message", Static).update(Text(one_line(text)), layout=False)

    def draw_at(self, rate_hz: float, draw: Callable[[], None]) -> None:
        """Draw ``rate_hz`` times a second while the screen runs: its widgets are removed one by one at the end."""

        def draw_if_there() -> None:
            if self.is_running:
                draw()

        self.set_interval(1 / rate_hz, draw_if_there)

    def _fail(self, failure: ChefbotError) -> None:
        self.failure = self.failure or failure
        self.exit()

    @staticmethod
    def now_s() -> float:
        """The loop's time."""
        return asyncio.get_running_loop().time()
