"""How much of the tests is run: what the environment asks for, and what the fast tier has of it."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

TIERS = ("fast", "full", "rest")
"""What belongs to every change; everything; what the fast tier leaves out, and what an installed package may lack."""

FAST_EXAMPLES = 20

HERE = Path(__file__).parent
PACKAGED = (
    "chefbotd/cli/programs",
    "chefbotd/client/test_sync.py",
    "chefbotd/process/installation",
    "chefbotd/settings",
    "chefbotd/components/simulation",
    "chefbotd/testing",
    "chefbotd/test_start.py",
    "chefbotd/transport/web",
    "test_first_steps.py",
)
"""Tests of what a wheel can lack though the sources have it: commands, files that are no modules, what starts first."""


def tier_of(text: str) -> str:
    """The tier that the environment asks for; raises ``ValueError`` where there is none of that name."""
    if text not in TIERS:
        raise ValueError(f"TEST_TIER must be one of {', '.join(TIERS)}, got {text!r}")
    return text


TIER = tier_of(os.environ.get("TEST_TIER", "fast"))
IS_FULL = TIER != "fast"


def is_left(item: pytest.Item) -> bool:
    """Whether a test remains to be run against the wheel where the fast tier has been run from the sources.

    Those that it leaves out or tries with fewer examples, and those of what is ``PACKAGED``.
    """
    tries_more = getattr(getattr(item, "obj", None), "is_hypothesis_test", False)
    asks = hasattr(getattr(item, "module", None), "IS_FULL")
    rooms = {HERE / name for name in PACKAGED}
    is_packaged = not rooms.isdisjoint((item.path, *item.path.parents))
    return item.get_closest_marker("slow") is not None or tries_more or asks or is_packaged


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
