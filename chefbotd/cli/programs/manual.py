"""Makes the manual pages of both programs from ``--help``: ``python -m chefbotd.cli.programs.manual FOLDER``.

One page for each program, and one for each of its commands (``man chefbotctl``, ``man chefbotctl-drive``), in roff
(man(7)) or as Markdown for the site.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import click

from chefbotd import __version__
from chefbotd.cli.programs import chefbotctl, chefbotd

PROGRAMS: tuple[click.Group, ...] = (chefbotd.main, chefbotctl.main)


def pages() -> Iterator[tuple[str, click.Context]]:
    """Every command by the name of its page, each program before its commands."""
    for program in PROGRAMS:
        yield from _pages(click.Context(program, info_name=program.name), str(program.name))


def _pages(context: click.Context, name: str) -> Iterator[tuple[str, click.Context]]:
    yield name, context
    command = context.command
    if isinstance(command, click.Group):
        for inner in command.list_commands(context):
            inner_command = command.get_command(context, inner)
            if inner_command is not None and not inner_command.hidden:
                child = click.Context(inner_command, info_name=inner, parent=context)
                yield from _pages(child, f"{name}-{inner}")


def roff(name: str, context: click.Context) -> str:
    """A page in roff."""
    command = context.command
    summary = _one_line(command.get_short_help_str(500))
    lines = [
        f'.TH "{name.upper()}" "1" "" "chefbotd {__version__}" "chefbotd"',
        ".SH NAME",
        f"{_escape_roff(name)} \\- {_escape_roff(summary)}",
        ".SH SYNOPSIS",
        f".B {_escape_roff(context.command_path)}",
        _escape_roff(" ".join(command.collect_usage_pieces(context))),
        ".SH DESCRIPTION",
        *(f".PP\n{_escape_roff(_one_line(text))}" for text in _paragraphs(command.help or "")),
    ]
    for title, rows in _sections(context):
        lines.append(f".SH {title}")
        lines += [f".TP\n.B {_escape_roff(term)}\n{_escape_roff(text)}" for term, text in rows]
    if command.epilog:
        lines += [".SH NOTES", ".nf", _escape_roff(command.epilog.replace("\b", "").strip("\n")), ".fi"]
    lines += [".SH SEE ALSO", ", ".join(f"{page}(1)" for page in _related_pages(name, context))]
    return "\n".join(lines) + "\n"


def markdown(name: str, context: click.Context) -> str:
    """A page's part of the site."""
    command = context.command
    usage = f"{context.command_path} {' '.join(command.collect_usage_pieces(context))}"
    lines = [f"## `{context.command_path}`", "", f"    {usage}", ""]
    for text in _paragraphs(command.help or ""):
        lines += [_one_line(text).replace("<", "\\<"), ""]
    for title, rows in _sections(context):
        lines += [f"| {title.lower()} | |", "|---|---|"]
        lines += [f"| `{term.replace('|', chr(92) + '|')}` | {_cell(text)} |" for term, text in rows]
        lines.append("")
    if command.epilog:
        lines += ["```text", command.epilog.replace("\b", "").strip("\n"), "```", ""]
    return "\n".join(lines)


def _sections(context: click.Context) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    command = context.command
    records = [record for item in command.get_params(context) if (record := item.get_help_record(context))]
    if records:
        yield "OPTIONS", [(term, _one_line(text)) for term, text in records]
    variables = [
        (str(item.envvar), f"as {item.opts[0]}")
        for item in command.get_params(context)
        if isinstance(item, click.Option) and item.envvar
    ]
    if variables:
        yield "ENVIRONMENT", variables
    if isinstance(command, click.Group):
        inner = [(item, command.get_command(context, item)) for item in command.list_commands(context)]
        rows = [
            (item, inner_command.get_short_help_str(500))
            for item, inner_command in inner
            if inner_command and not inner_command.hidden
        ]
        yield "COMMANDS", rows


def _related_pages(name: str, context: click.Context) -> list[str]:
    """The page above this one, or the other program's."""
    if context.parent is not None:
        return [name.removesuffix(f"-{context.info_name}")]
    return [str(program.name) for program in PROGRAMS if program.name != name]


def _paragraphs(text: str) -> list[str]:
    return [paragraph for paragraph in re.split(r"\n\s*\n", text.replace("\b", "").strip()) if paragraph]


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _escape_roff(text: str) -> str:
    """No backslash, hyphen or leading dot that roff takes for its own."""
    lines = text.replace("\\", "\\e").replace("-", "\\-").splitlines()
    return "\n".join(f"\\&{line}" if line.startswith((".", "'")) else line for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "\\<")


def write(folder: Path) -> int:
    """Write every page into a folder of section 1; how many there are."""
    folder.mkdir(parents=True, exist_ok=True)
    count = 0
    for name, context in pages():
        (folder / f"{name}.1").write_text(roff(name, context), encoding="utf-8")
        count += 1
    return count


if __name__ == "__main__":
    click.echo(f"wrote {write(Path(sys.argv[1]))} pages into {sys.argv[1]}")
