"""What the screens of chefbotctl share: parts that run beside them, a line for messages, an end with a reason."""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from typing import Any, ClassVar

from textual.app import App
from textual.widgets import Static

from chefbotd.client import CallError, CallTimeout, ChefbotError, Client, ConnectionLost

NOT_ASKED = "The connection is lost: the daemon may not have got this."


class RobotScreen(App[None]):
    """A screen over one robot; ``failure`` is what ended it, when it was not the user."""

    ENABLE_COMMAND_PALETTE = False
    BASE_CSS: ClassVar[str] = """
    #title { background: $primary; color: $text; height: 1; padding: 0 1; text-style: bold; }
    #message { height: 1; padding: 0 1; color: $warning; dock: bottom; }
    """

    def __init__(self, robot: Client, address: str, *, reconnects: bool = False) -> None:
        """With ``reconnects`` the client opens a lost connection again, and the screen waits for that."""
        super().__init__()
        self.reconnects = reconnects
        self.robot, self.heading = robot, f"{robot.hello.robot} at {address}"
        self.failure: ChefbotError | None = None
        self._parts: list[asyncio.Task[None]] = []

    async def show(self) -> None:
        """Until the user quits; raises the client's error when that is what ended it."""
        await self.run_async(mouse=False)
        if self.failure is not None:
            raise self.failure

    def run_beside(self, *parts: Coroutine[Any, Any, None]) -> None:
        """Run these until the screen goes; an error of the client's in one of them ends the screen."""
        self._parts += [asyncio.create_task(self._guarded(part)) for part in parts]

    async def _guarded(self, part: Coroutine[Any, Any, None]) -> None:
        try:
            await part
        except ChefbotError as failure:
            self._fail(failure)

    async def on_unmount(self) -> None:
        """Textual: the screen is going; the parts have their last word."""
        for part in self._parts:
            part.cancel()
        await asyncio.gather(*self._parts, return_exceptions=True)

    async def action_leave(self) -> None:
        """Textual: a key that quits."""
        self.exit()

    async def wait_for_connection(self, loss: ConnectionLost) -> None:
        """After a ``ConnectionLost``: until the connection stands again; raises it if nobody opens it again."""
        if not self.reconnects:
            raise loss
        while True:
            with contextlib.suppress(CallTimeout):
                return await self.robot.wait_until_connected()

    async def ask(self, request: Coroutine[Any, Any, object], done: str) -> None:
        """Ask something of the robot and say that it is done, or why it was refused."""
        try:
            await request
        except CallError as error:
            done = f"{error.kind}: {error.message}"
        except ConnectionLost as loss:
            done = NOT_ASKED
            if not self.reconnects:
                self._fail(loss)
        except ChefbotError as failure:
            self._fail(failure)
        self.say(done)

    def say(self, text: str) -> None:
        """Show it on the line for messages."""
        if self.is_running:
            self.query_one("#message", Static).update(text)

    def draw_at(self, rate_hz: float, draw: Callable[[], None]) -> None:
        """Draw so often, but not on a screen that is being taken down, whose widgets go one by one."""

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
