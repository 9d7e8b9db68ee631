"""A finding: the check, its verdict, the measurement, and what to do."""

from collections.abc import Iterable
from enum import StrEnum

from chefbotd.core.record import Record


class Verdict(StrEnum):
    """The verdict of a check."""

    OK = "ok"
    WARNING = "warning"
    PROBLEM = "problem"
    SKIPPED = "skipped"


class Finding(Record, frozen=True):
    """The result of one check.

    ``check`` is a stable name for scripts, ``measured`` and ``advice`` are sentences for people. A check that was
    skipped says in ``measured`` why, and in ``advice`` how it can be done.
    """

    check: str
    verdict: Verdict
    measured: str
    advice: str = ""


def ok(check: str, measured: str) -> Finding:
    """All is well."""
    return Finding(check, Verdict.OK, measured)


def warning(check: str, measured: str, advice: str) -> Finding:
    """It works, and may not always."""
    return Finding(check, Verdict.WARNING, measured, advice)


def problem(check: str, measured: str, advice: str) -> Finding:
    """It does not work, or is not safe."""
    return Finding(check, Verdict.PROBLEM, measured, advice)


def skip_check(check: str, measured: str, advice: str = "") -> Finding:
    """It was not looked at, and why."""
    return Finding(check, Verdict.SKIPPED, measured, advice)


def worst(findings: Iterable[Finding]) -> Verdict:
    """The worst verdict; ``OK`` without findings, or if all checks were skipped."""
    verdicts = {finding.verdict for finding in findings}
    for bad in (Verdict.PROBLEM, Verdict.WARNING):
        if bad in verdicts:
            return bad
    return Verdict.OK
