"""A place that is not on the map: the nearest names are offered."""

import pytest

from chefbotd.components.maps.storage.places import describe_unknown

NAMES = ["kitchen", "Table 2", "table 3", "sofa"]


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("kichen", "did you mean 'kitchen'?"),
        ("SOFA", "did you mean 'sofa'?"),
        ("table2", "did you mean 'Table 2' or 'table 3'?"),
        ("zzz", "there are: kitchen, Table 2, table 3, sofa"),
    ],
)
def test_the_nearest_names_are_offered(asked: str, told: str) -> None:
    """Whatever the case; where none is near, all are named."""
    assert describe_unknown(asked, NAMES) == told


def test_a_map_without_places_says_so() -> None:
    """There is nothing to offer."""
    assert describe_unknown("sofa", []) == "there are: none"
