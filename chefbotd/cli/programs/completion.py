"""The command that prints a shell's completion script, the same for both programs."""

import click
from click.shell_completion import get_completion_class

from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError

SHELLS = ("bash", "zsh", "fish")


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def completion(ctx: click.Context, shell: str) -> None:
    """Print the script that completes commands in SHELL.

    In bash: eval "$(PROGRAM completion bash)".
    """
    root = ctx.find_root()
    program = root.command.name or ""
    completer = get_completion_class(shell)
    if completer is None:
        raise ProgramError(Exit.FAILED, f"this version of click cannot complete {shell}")
    variable = f"_{program}_COMPLETE".upper().replace("-", "_")
    echo(completer(root.command, {}, program, variable).source())
