"""Prints results: JSON for scripts, tables for people. rich is imported only to draw."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from chefbotd.cli.common import state_text
from chefbotd.cli.common.echo import WIDEST, echo, say_sentences, writing
from chefbotd.cli.common.strangers import strangers_rows
from chefbotd.client import Event

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

Data = Mapping[str, Any]


def say(as_json: bool, value: object, text: str) -> None:
    """Print a JSON object, or a sentence."""
    if as_json:
        echo(_json(value))
    else:
        say_sentences(text)


def _json(value: object) -> str:
    """A value, or a record that the daemon sent, as it went over the wire."""
    from chefbotd.rpc.encoding import plain

    return json.dumps(plain(value))


def _show(as_json: bool, value: object, draw: Callable[[], "RenderableType"]) -> None:
    if as_json:
        echo(_json(value))
        return
    from chefbotd.cli.common.console import Printer

    with writing():
        printer = Printer(highlight=False)
        printer.width = min(printer.width, WIDEST)
        printer.print(draw())


def _table(*columns: str) -> "Table":
    from rich import box
    from rich.table import Column, Table

    folding = [Column(header, overflow="fold") for header in columns]
    return Table(*folding, box=box.SIMPLE_HEAD, pad_edge=False)


def table(as_json: bool, value: object, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a JSON object, or a table."""

    def draw() -> "Table":
        from rich.text import Text

        drawn = _table(*columns)
        for row in rows:
            drawn.add_row(*map(Text, row))
        return drawn

    _show(as_json, value, draw)


def status(as_json: bool, answer: Data) -> None:
    """The state and the counters."""
    _show(as_json, answer, lambda: status_table(answer))


def status_table(answer: Data) -> "Table":
    """The state and the counters, a line each."""
    from rich.text import Text

    table = _table(answer["robot"], f"protocol {answer['protocol']}, session {answer['session']}", "age")
    for fact in [
        *state_text.of_state(answer, strangers_rows(answer.get("plugins", ()))),
        state_text.counters(answer["stats"]),
    ]:
        age = "" if fact.age_s is None else f"{fact.age_s:.3f} s"
        table.add_row(fact.label, Text(fact.text, style=fact.style), Text(age, style=state_text.Style.FAINT))
    return table


def event(
    as_json: bool, event: Event[Any], select: Callable[[str, Data], Mapping[str, Any]] = lambda _, data: data
) -> None:
    """One event on one line; ``select`` says what of a topic's data is printed."""
    from chefbotd.rpc.encoding import plain  # loaded when it was subscribed

    data = select(event.topic, plain(event.data))
    if as_json:
        value = {"topic": event.topic, "seq": event.seq, "stamp_s": event.stamp_s, "age_s": event.age_s}
        echo(json.dumps({**value, "data": data}))
    else:
        fields = " ".join(f"{name}={_brief(value)}" for name, value in data.items())
        echo(f"{event.stamp_s:.3f} {event.topic} {fields}")


def _brief(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return "[" + ",".join(map(_brief, value)) + "]"
    if isinstance(value, dict):
        return "{" + ",".join(f"{k}={_brief(v)}" for k, v in value.items()) + "}"
    if value is None or isinstance(value, bool):
        return str(value).lower()  # the words that ``pid set`` accepts
    return str(value)


def gains(as_json: bool, wheels: Mapping[str, Data]) -> None:
    """Every wheel's gains, one column a wheel."""
    _show(as_json, {"wheels": wheels}, lambda: _gains(wheels))


def _gains(wheels: Mapping[str, Data]) -> "Table":
    table = _table("gain", *wheels)
    names = dict.fromkeys(name for one in wheels.values() for name in one)
    for name in names:
        table.add_row(name, *(_brief(gains.get(name)) for gains in wheels.values()))
    return table


def description(as_json: bool, answer: Data) -> None:
    """The methods and topics, with what each takes or carries."""
    _show(as_json, answer, lambda: _description(answer))


def _description(answer: Data) -> "Table":
    table = _table("", "name", "fields", "meaning")
    for name, method in answer["methods"].items():
        table.add_row("method", name, _fields(method["params"]), method["summary"])
    for name, topic in answer["topics"].items():
        table.add_row("topic", name, _fields(topic["data"]), topic["summary"])
    return table


def _fields(schema: Data) -> str:
    return " ".join(schema.get("properties", {}))


@contextmanager
def countdown(seconds: float, console: "Console") -> Iterator[Callable[[float], None]]:
    """A progress bar over ``seconds`` where there is a terminal."""
    if console.quiet or not console.is_terminal:
        yield lambda gone_s: None
        return
    from rich.progress import BarColumn, Progress, TextColumn

    elapsed = TextColumn("{task.completed:.1f} of {task.total:.1f} s")
    bar = Progress(TextColumn("driving"), BarColumn(), elapsed, console=console, transient=True)
    with bar:
        task = bar.add_task("driving", total=seconds)
        yield lambda gone_s: bar.update(task, completed=gone_s)
