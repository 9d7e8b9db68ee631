"""The A* in C++ that ours is compared with."""

import math

import numpy as np
import pytest

from benchmarks import astar, planner
from benchmarks.astar import SEARCHES, CompiledSearches, built_library, missing_packages

MISSING = missing_packages()


@pytest.mark.slow
@pytest.mark.skipif(MISSING is not None, reason=f"apt-get install {MISSING}")
def test_each_search_cuts_no_corner_and_counts_the_costs() -> None:
    """Round the blocked cell it takes three straight steps, each at the mean of two cells; nothing passes the wall."""
    costs = np.array([[1, 1, 2], [1, np.inf, 1], [1, 1, 1], [np.inf] * 3, [1, 1, 1]], np.float32)
    with built_library() as library:
        searches = CompiledSearches(library, costs)
        for name in SEARCHES:
            assert searches.cost(name, (0, 0), (1, 2)) == pytest.approx(1 + 1.5 + 1.5)
            assert searches.cost(name, (0, 0), (0, 1)) == 1.0
            assert searches.cost(name, (0, 0), (4, 0)) == math.inf
        searches.close()


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a compiler and Boost no ratio is shown, and the remark has the packages."""
    monkeypatch.setattr(astar.shutil, "which", lambda _: None)
    monkeypatch.setattr(astar, "BOOST", astar.SOURCE / "none")
    monkeypatch.setattr(planner, "QUICK_PLANS", 1)
    outcome = planner.run(quick=True, folder=astar.SOURCE.parent / "none")
    assert "no ratio to an A* in C++: apt-get install g++ libboost-dev" in outcome.remarks
    assert not [figure for figure in outcome.figures if "C++" in figure.name]
