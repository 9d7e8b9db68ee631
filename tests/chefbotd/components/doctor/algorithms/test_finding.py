"""Verdicts."""

import pytest

from chefbotd.components.doctor.algorithms.finding import (
    Finding,
    Verdict,
    ok,
    problem,
    skip_check,
    warning,
    worst,
)

OK, WARNING = ok("a", "it is"), warning("b", "it may", "look")
PROBLEM, SKIPPED = problem("c", "it is not", "mend it"), skip_check("d", "nobody asked")


@pytest.mark.parametrize(
    ("findings", "verdict"),
    [
        ((), Verdict.OK),
        ((SKIPPED,), Verdict.OK),
        ((OK, SKIPPED), Verdict.OK),
        ((OK, WARNING), Verdict.WARNING),
        ((WARNING, PROBLEM, OK), Verdict.PROBLEM),
    ],
)
def test_the_worst_of_findings(findings: tuple[Finding, ...], verdict: Verdict):
    """A problem outweighs a warning, a warning all else; what was skipped is not bad."""
    assert worst(findings) is verdict
