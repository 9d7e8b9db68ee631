"""Prints findings: a line for the measurement, and a line for what to do."""

import json
from collections.abc import Sequence

import click
from msgspec.structs import asdict

from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit
from chefbotd.components.doctor.algorithms.finding import Finding, Verdict, worst

COLOURS = {
    Verdict.OK: "green",
    Verdict.WARNING: "yellow",
    Verdict.PROBLEM: "red",
    Verdict.SKIPPED: "bright_black",
}
EXITS = {Verdict.OK: Exit.OK, Verdict.WARNING: Exit.WARNINGS, Verdict.PROBLEM: Exit.PROBLEMS}


def show(finding: Finding) -> None:
    """A finding on a terminal, as soon as it is made."""
    word = click.style(
        f"{finding.verdict:8}", fg=COLOURS[finding.verdict], bold=finding.verdict == Verdict.PROBLEM
    )
    echo(f" {finding.check}: {finding.measured}.", styled=word)
    if finding.advice:
        echo(f"{'':8} -> {_sentence(finding.advice)}")


def _sentence(text: str) -> str:
    text = text[:1].upper() + text[1:]
    return text if text.endswith((".", "?")) else f"{text}."


def summary(findings: Sequence[Finding]) -> str:
    """How many of each."""
    counts = {verdict: sum(finding.verdict is verdict for finding in findings) for verdict in Verdict}
    texts = {
        Verdict.OK: "{} ok",
        Verdict.WARNING: "{} warning{}",
        Verdict.PROBLEM: "{} problem{}",
        Verdict.SKIPPED: "{} skipped",
    }
    return ", ".join(texts[verdict].format(n, "" if n == 1 else "s") for verdict, n in counts.items() if n)


def as_data(findings: Sequence[Finding]) -> dict[str, object]:
    """Findings for scripts."""
    return {"verdict": str(worst(findings)), "findings": [asdict(finding) for finding in findings]}


def as_json(findings: Sequence[Finding], **more: object) -> str:
    """The same as one line."""
    return json.dumps({**as_data(findings), **more})


def exit_code(findings: Sequence[Finding]) -> Exit:
    """0 where all is well or skipped, or one of its own for warnings and for problems."""
    return EXITS[worst(findings)]
