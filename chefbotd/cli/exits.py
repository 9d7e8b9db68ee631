"""What the programs' exit codes mean: one table, shown in ``--help`` and used by every command."""

import json
from enum import IntEnum
from typing import Any

import click


class Exit(IntEnum):
    """The exit codes of chefbotd and chefbotctl."""

    OK = 0
    FAILED = 1
    USAGE = 2
    CANNOT_CONNECT = 3
    REFUSED = 4
    CONNECTION_LOST = 5
    NOT_DONE = 6
    NOT_INSTALLED = 7
    BAD_CONFIGURATION = 78
    INTERRUPTED = 130


MEANING = {
    Exit.OK: "done",
    Exit.FAILED: "an error that none of the others describes",
    Exit.USAGE: "wrong arguments",
    Exit.CANNOT_CONNECT: "no daemon answers at the address",
    Exit.REFUSED: "the robot refused (the kind of refusal is printed)",
    Exit.CONNECTION_LOST: "the connection broke or an answer did not come",
    Exit.NOT_DONE: "the motion did not end as asked",
    Exit.NOT_INSTALLED: "an optional part of the program is not installed",
    Exit.BAD_CONFIGURATION: "the configuration is not valid",
    Exit.INTERRUPTED: "interrupted by a signal",
}


def exit_table(*codes: Exit) -> str:
    """The meaning of these codes as an epilog of ``--help``; the backspace keeps click from wrapping it."""
    rows = "\n".join(f"  {int(code):3d}  {MEANING[code]}" for code in sorted(codes))
    return f"\b\nExit codes:\n{rows}"


class ProgramError(Exception):
    """Ends the program: the exit code, a message for people, and details for a script."""

    def __init__(self, code: Exit, message: str, **details: object) -> None:
        super().__init__(message)
        self.code = code
        self.details = details


class Program(click.Group):
    """A group of commands whose failures and interruptions become exit codes.

    The message goes to stderr; as one JSON object where ``--json`` was asked for.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that was named."""
        try:
            return super().invoke(ctx)
        except ProgramError as failure:
            self._report(failure, bool(ctx.params.get("as_json", False)))
            ctx.exit(failure.code)
        except KeyboardInterrupt:
            click.echo("Interrupted.", err=True)
            ctx.exit(Exit.INTERRUPTED)

    def _report(self, failure: ProgramError, as_json: bool) -> None:
        if as_json:
            error = {"exit_code": int(failure.code), "message": str(failure), **failure.details}
            click.echo(json.dumps({"error": error}), err=True)
        else:
            click.echo(f"Error: {failure}", err=True)
