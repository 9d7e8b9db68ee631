"""A Python prompt with the robot, on IPython. Whatever goes wrong in it stops the robot."""

import contextlib
import sys
from typing import Any, Protocol

from IPython.core.interactiveshell import ExecutionResult
from IPython.terminal.interactiveshell import TerminalInteractiveShell
from traitlets.config import Config

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.client import ChefbotError, SyncClient

BANNER = """{name} is connected as robot. robot.<Tab> completes, robot.drive_for? explains, exit() ends.
Ctrl-C, and whatever raises an error, stops the robot."""


class Stoppable(Protocol):
    """What is stopped."""

    def stop(self) -> object:
        """Brake to standstill."""
        ...


class RobotShell(TerminalInteractiveShell):
    """IPython, which stops ``robot`` after an error, and on Ctrl-C at the prompt or in a command."""

    robot: Stoppable
    _stopped_for: BaseException | None = None

    def connect(self, robot: Stoppable) -> None:
        """From now on this robot is stopped."""
        self.robot = robot
        self.events.register("post_run_cell", self._after_cell)

    def stop_robot(self) -> None:
        """Stop it, and say so; who is not connected any more cannot, and its daemon has stopped it."""
        try:
            self.robot.stop()
        except ChefbotError as error:
            echo(
                f"The robot could not be told to stop ({error}): its daemon brakes for a client that is gone."
            )
        else:
            echo("The robot was stopped.")

    def showtraceback(
        self, exc_tuple: tuple[Any, BaseException, Any] | None = None, *args: Any, **options: Any
    ) -> None:
        """Stop the robot before the error is shown: also one that a magic such as ``%run`` shows and does not raise."""
        error = exc_tuple[1] if exc_tuple is not None else sys.exc_info()[1]
        if error is not None:
            self._stop_for(error)
        super().showtraceback(exc_tuple, *args, **options)

    def _after_cell(self, result: ExecutionResult) -> None:
        error = result.error_before_exec or result.error_in_exec
        if error is not None and not isinstance(error, SystemExit):
            self._stop_for(error)

    def _stop_for(self, error: BaseException) -> None:
        """Once for each error."""
        if error is not self._stopped_for:
            self._stopped_for = error
            self.stop_robot()

    def init_prompt_toolkit_cli(self) -> None:
        """Ctrl-C at the prompt interrupts, where IPython only empties the line."""
        super().init_prompt_toolkit_cli()  # type: ignore[no-untyped-call]
        if self.simple_prompt:
            return
        session: Any = self.pt_app
        session.key_bindings.add("c-c")(_interrupt)

    def prompt_for_code(self) -> str:
        """The next input; raises KeyboardInterrupt after the robot was stopped."""
        try:
            code: str = super().prompt_for_code()  # type: ignore[no-untyped-call]
        except KeyboardInterrupt:
            self.stop_robot()
            raise
        return code


def _interrupt(event: Any) -> None:
    """As prompt_toolkit's own binding, which IPython replaces."""
    event.current_buffer.reset()
    event.app.exit(exception=KeyboardInterrupt, style="class:aborting")


def configuration() -> Config:
    """No file of the user's is run, and nobody is asked whether to leave."""
    config = Config()
    config.TerminalInteractiveShell.confirm_exit = False
    config.TerminalInteractiveShell.banner1 = ""
    return config


def run_shell(context: CommandContext, name: str) -> None:
    """Until the user leaves; the robot brakes then, as after every client."""
    where, credentials = context.address, context.credentials
    with SyncClient.connect(
        where.host, where.port, token=credentials.token, tls=credentials.tls, name="shell", reconnect=True
    ) as robot:
        shell = RobotShell.instance(config=configuration(), user_ns={"robot": robot})
        shell.connect(robot)
        echo(BANNER.format(name=name))
        with contextlib.suppress(ChefbotError):  # lost at the end: then the daemon brakes
            shell.mainloop()  # type: ignore[no-untyped-call]
