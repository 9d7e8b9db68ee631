"""How much of the tests is run: what the environment asks for, and what the fast tier has of it."""

import os
from collections.abc import Sequence
from typing import Any

import pytest

IS_FULL = os.environ.get("TEST_TIER") == "full"
FAST_EXAMPLES = 20


def examples(count: int) -> int:
    """How many examples Hypothesis tries: all of them in the full tier, 20 at most in the fast one."""
    return count if IS_FULL else min(count, FAST_EXAMPLES)


def sample(cases: Sequence[Any], fast: int = 1) -> list[Any]:
    """Parameter sets of which the fast tier runs the first ones only; the others are marked slow."""
    marks = [()] * fast + [pytest.mark.slow] * (len(cases) - fast)
    return [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=mark)
        for case, mark in zip(cases, marks, strict=True)
    ]
