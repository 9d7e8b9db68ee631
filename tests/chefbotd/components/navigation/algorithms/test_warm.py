"""What is compiled before the first goal."""

from collections.abc import Iterator

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.arcs import _check
from chefbotd.components.navigation.algorithms.costmap import _fill, _stamp
from chefbotd.components.navigation.algorithms.evade import _least_m
from chefbotd.components.navigation.algorithms.live import _see
from chefbotd.components.navigation.algorithms.movers import _stamp_people
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.removed import _trace
from chefbotd.components.navigation.algorithms.search import _search
from chefbotd.components.navigation.algorithms.smooth import _pull, _relax
from chefbotd.components.navigation.algorithms.warm import warm
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND, Person
from tests.chefbotd.components.navigation.algorithms.test_navigator import hall
from tests.chefbotd.components.navigation.algorithms.test_removed import CUPBOARD, GOES_TO_LOOK, mapped, sent

KERNELS = (_check, _fill, _stamp, _see, _search, _pull, _relax, _stamp_people, _least_m, _trace)


@pytest.fixture
def counted() -> Iterator[None]:
    """Warmed; fails when a kernel gets another signature in the test."""
    warm(ROUND)
    before = [len(kernel.signatures) for kernel in KERNELS]
    assert all(before)
    yield
    assert [len(kernel.signatures) for kernel in KERNELS] == before


@pytest.mark.usefixtures("counted")
def test_after_warming_nothing_is_compiled_in_a_drive() -> None:
    """No kernel gets another signature when a goal is driven to."""
    person = Person(np.array([[6.0, 1.3], [1.0, 1.4]]), speed_m_s=0.6)
    drive = hall(box(2.0, 1.3, 0.3, 0.3, 0.2), people=[person])
    drive.navigator.navigate_to((Goal(6.0, 1.5, 0.0),))
    drive.run(6.0)
    assert drive.way_m > 0.2


@pytest.mark.usefixtures("counted")
def test_after_warming_nothing_is_compiled_when_a_thing_is_gone() -> None:
    """Neither when beams go through a thing of the map, nor when it is taken off the costs."""
    drive = sent(mapped(CUPBOARD))
    assert GOES_TO_LOOK in drive.said
    assert drive.ended
