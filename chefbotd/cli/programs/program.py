"""What chefbotd and chefbotctl share: failures become exit codes, --json may stand anywhere, shells can complete."""

import io
import json
import sys
from collections.abc import Mapping
from copy import copy
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import click

from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.extras import how_to_add_folder

JSON_HELP = "Print JSON for scripts; failures too, on stderr."
_JSON = f"{__name__}.json"


@runtime_checkable
class SupportsJson(Protocol):
    """An object for commands (``ctx.obj``) that can be switched to JSON output."""

    def in_json(self) -> Self:
        """A copy that prints JSON."""
        ...


def wants_json(ctx: click.Context) -> bool:
    """Whether ``--json`` was given so far, before or after the command's name."""
    return bool(ctx.meta.get(_JSON))


def _set_json(ctx: click.Context, _param: click.Parameter, chosen: bool) -> None:
    if chosen:
        ctx.meta[_JSON] = True  # shared by the contexts of a program and of its command
        if isinstance(ctx.obj, SupportsJson):
            ctx.obj = ctx.obj.in_json()


def _json_option() -> click.Option:
    return click.Option(["--json"], is_flag=True, expose_value=False, callback=_set_json, help=JSON_HELP)


STRANGERS = f"{__name__}.strangers"


class CommandGroup(click.Group):
    """A group of commands whose failures and interruptions become exit codes; it and each of them take ``--json``.

    The message goes to stderr; as one JSON object where ``--json`` was asked for.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.append(_json_option())
        self._late: dict[str, str] = {}
        self._attributes: dict[str, str] = {}
        self._inner: dict[str, dict[str, str]] = {}
        self._has_strangers = False

    def add_strangers(self) -> None:
        """Add the commands of installed components; they are looked for when no own one fits, or all are shown."""
        self._has_strangers = True

    def add_late(self, module: str, *names: str) -> None:
        """Add commands by their names; their module is imported when one of them is called, or all are shown."""
        self._late |= dict.fromkeys(names, module)

    def add_referenced(self, references: Mapping[str, str]) -> None:
        """Add commands by their names, each ``module:attribute``; imported as those of ``add_late`` are.

        One whose name has two words is a command of the group that the first word names: ``map edit``.
        """
        for name, reference in references.items():
            group, _, inner = name.rpartition(" ")
            if group:
                self._inner.setdefault(group, {})[inner] = reference
                continue
            module, _, attribute = reference.partition(":")
            self._late[name], self._attributes[name] = module, attribute

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name; None where there is none."""
        if module := self._late.pop(cmd_name, None):
            attribute = self._attributes.get(cmd_name, cmd_name.replace("-", "_"))
            late = _late_command(module, cmd_name, attribute)
            self.add_command(_with_inner(late, self._inner.get(cmd_name, {})), cmd_name)
        command = super().get_command(ctx, cmd_name)
        if command is None:
            command = self._strangers(ctx).get(cmd_name)
        if command is None and self._late:  # click suggests commands of similar names: load them all
            for name in tuple(self._late):
                self.get_command(ctx, name)
        return command

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Every name."""
        return sorted({*super().list_commands(ctx), *self._late, *self._strangers(ctx)})

    def _strangers(self, ctx: click.Context) -> dict[str, click.Command]:
        """The commands of installed components, looked for once in each call of the program."""
        if not self._has_strangers:
            return {}
        if STRANGERS not in ctx.meta:
            from chefbotd.cli.common.strangers import strangers_command, strangers_commands

            own_names = {*self.commands, *self._late}
            loaded = {
                name: strangers_command(name, reference)
                for name, reference in strangers_commands().items()
                if name not in own_names
            }
            ctx.meta[STRANGERS] = {
                name: _with_json(command) for name, command in loaded.items() if command is not None
            }
        commands: dict[str, click.Command] = ctx.meta[STRANGERS]
        return commands

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command, or a group with all its commands."""
        super().add_command(_with_json(cmd), name)

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the program. Characters that the output's encoding lacks, such as a degree sign in ASCII, become ``?``."""
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="replace")
        return super().main(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that was named."""
        try:
            return super().invoke(ctx)
        except ProgramError as failure:
            if failure.code is not Exit.OUTPUT_CLOSED:  # closed by the reader, such as head: print nothing
                self._report_failure(failure, wants_json(ctx))
            ctx.exit(failure.code)
        except KeyboardInterrupt:
            tell("Interrupted.")
            ctx.exit(Exit.INTERRUPTED)

    def _report_failure(self, failure: ProgramError, as_json: bool) -> None:
        if as_json:
            error = {"exit_code": int(failure.code), "message": str(failure), **failure.details}
            tell(json.dumps({"error": error}), folded=False)
        else:
            tell(f"Error: {failure}")


def _with_inner(command: click.Command, references: Mapping[str, str]) -> click.Command:
    """A group with more commands, which other components bring; a copy, as another program may have the group."""
    if not references or not isinstance(command, click.Group):
        return command
    group = copy(command)
    group.commands = dict(command.commands)
    for name, reference in references.items():
        module, _, attribute = reference.partition(":")
        group.commands[name] = _late_command(module, name, attribute)
    return group


def _with_json(command: click.Command) -> click.Command:
    """A copy that takes ``--json``, as do its subcommands. A copy, because another program may have the same command."""
    taking = copy(command)
    taking.params = [*command.params, _json_option()]
    if isinstance(taking, click.Group):
        taking.commands = {name: _with_json(inner) for name, inner in taking.commands.items()}
    return taking


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
    from click.shell_completion import get_completion_class  # no other command needs it

    completer = get_completion_class(shell)
    if completer is None:
        raise ProgramError(Exit.FAILED, f"this version of click cannot complete {shell}")
    variable = f"_{program}_COMPLETE".upper().replace("-", "_")
    echo(completer(root.command, {}, program, variable).source())


def example(name: str, make_target: str) -> click.Command:
    """The command of this name in ``examples/commands.py``.

    Where there is no such file, a command that says where it is, and that is not listed.
    """
    spec = find_spec("examples")
    folders = () if spec is None else spec.submodule_search_locations or ()
    if any((Path(folder) / "commands.py").exists() for folder in folders):
        command: click.Command = getattr(import_module("examples.commands"), name)
        return command
    only = "is a demonstration, which only the sources of chefbotd have"
    return _absent(name, f"{only}: run 'make {make_target}' in a checkout")


def _late_command(module: str, name: str, attribute: str) -> click.Command:
    """The command in a module of ours, or of an add-on; where that is not installed, a hidden one that says so."""
    package = module.partition(".")[0]
    if package != __package__.partition(".")[0] and find_spec(package) is None:
        add_on = package.replace("_", "-")
        return _absent(
            name, f"is in {add_on}: in a checkout of chefbotd, {how_to_add_folder(f'./addons/{add_on}')}"
        )
    command: click.Command = getattr(import_module(module), attribute)
    return command


def _absent(name: str, where: str) -> click.Command:
    @click.command(name, hidden=True, context_settings={"ignore_unknown_options": True})
    @click.argument("words", nargs=-1)
    @click.pass_context
    def command(ctx: click.Context, words: tuple[str, ...]) -> None:
        """Say where the command is."""
        raise ProgramError(Exit.NOT_INSTALLED, f"'{ctx.command_path}' {where}")

    return command
