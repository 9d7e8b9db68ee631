"""What is compiled before the first goal."""

import numpy as np

from chefbotd.navigation.arcs import _check
from chefbotd.navigation.costmap import _stamp
from chefbotd.navigation.evade import _least_m
from chefbotd.navigation.live import _see
from chefbotd.navigation.movers import _stamp_people
from chefbotd.navigation.path import Goal
from chefbotd.navigation.search import _search
from chefbotd.navigation.smooth import _pull, _relax
from chefbotd.navigation.warm import warm
from tests.chefbotd.mapping.slam.flat import box
from tests.chefbotd.navigation.drives import ROUND, Person
from tests.chefbotd.navigation.test_navigator import hall


def test_after_warming_nothing_is_compiled_in_a_drive() -> None:
    """No kernel gets another signature when a goal is driven to."""
    kernels = (_check, _stamp, _see, _search, _pull, _relax, _stamp_people, _least_m)
    warm(ROUND)
    before = [len(kernel.signatures) for kernel in kernels]
    assert all(before)
    person = Person(np.array([[6.0, 1.3], [1.0, 1.4]]), speed_m_s=0.6)
    drive = hall(box(2.0, 1.3, 0.3, 0.3, 0.2), people=[person])
    drive.navigator.navigate_to((Goal(6.0, 1.5, 0.0),))
    drive.run(6.0)
    assert drive.way_m > 0.2
    assert [len(kernel.signatures) for kernel in kernels] == before
