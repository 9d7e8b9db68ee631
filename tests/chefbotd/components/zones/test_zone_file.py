"""Zones in their file, changed one by one; expected contents are written out by hand."""

import pytest

from chefbotd.components.maps.outlines import why_no_area
from chefbotd.components.maps.storage.store import revision_of
from chefbotd.components.zones.zone_file import (
    NO_ZONES,
    ZONES,
    Wall,
    Zone,
    Zones,
    parse_zones,
    with_zones,
    without_zone,
    write_zones,
)

BY_HAND = """\
# what a person wrote
keep_out:
  - {name: stairs, corners_m: [[0, 0], [1, 0], [1, 2]]}
  - {id: glass, name: glass, enabled: false, corners_m: [[4, 0], [5, 0], [5, 2]]}
slow:
  - {name: counter, corners_m: [[3, 0], [5, 0], [5, 2]], max_speed_m_s: 0.1}
"""
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def test_what_a_person_wrote_has_ids_by_kind_and_place() -> None:
    """Two of three have none of their own."""
    assert [own for own, _ in parse_zones(BY_HAND, "zones.yaml").named()] == ["keep_out-1", "glass", "slow-1"]


def test_a_change_keeps_every_other_zone_with_its_id() -> None:
    """One more zone: all that were there are as before, and are called what they were called in the list."""
    before = parse_zones(BY_HAND, "zones.yaml")
    after = with_zones(before, {"new": Wall(id="new", name="rope", points_m=((0.1, 0.2), (3.0, 0.2)))})
    again = parse_zones(write_zones(after).decode(), "zones.yaml")
    assert again == after
    assert [own for own, _ in again.named()] == ["keep_out-1", "glass", "slow-1", "new"]
    assert again.keep_out[0].corners_m == before.keep_out[0].corners_m
    assert again.keep_out[1] == before.keep_out[1]
    assert again.walls[0].points_m == ((0.1, 0.2), (3.0, 0.2))


def test_a_zone_that_becomes_another_kind_is_there_once() -> None:
    """A keep-out zone that becomes a wall keeps its id, and is no keep-out zone any more."""
    before = parse_zones(BY_HAND, "zones.yaml")
    after = with_zones(before, {"glass": Wall(id="glass", points_m=((4.0, 0.0), (5.0, 2.0)))})
    assert [own for own, _ in after.named()] == ["keep_out-1", "slow-1", "glass"]


def test_a_zone_that_is_taken_away_changes_no_id() -> None:
    """The first keep-out zone goes; the second one is still called what it was."""
    zones = Zones(keep_out=(Zone(corners_m=SQUARE), Zone(corners_m=SQUARE)))
    left = without_zone(zones, "keep_out-1")
    assert [own for own, _ in left.named()] == ["keep_out-2"]


def test_two_zones_of_one_id_are_refused() -> None:
    """Nobody could say which one is meant."""
    text = "keep_out:\n" + 2 * "  - {id: a, corners_m: [[0, 0], [1, 0], [1, 2]]}\n"
    with pytest.raises(ValueError, match=r"zones.yaml: .*two zones have the id 'a'"):
        parse_zones(text, "zones.yaml")


def test_the_revision_follows_the_content() -> None:
    """An edit by hand is another revision, and so is the absence of the file."""
    assert revision_of(None) == "none"
    assert revision_of(write_zones(NO_ZONES)) != revision_of(BY_HAND.encode())
    assert revision_of(BY_HAND.encode()) == revision_of(BY_HAND.encode())


@pytest.mark.parametrize(
    ("corners_m", "reason"),
    [
        (SQUARE, ""),
        (((0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)), ""),  # a corner that points inwards
        (((0, 0), (1, 1), (1, 0), (0, 1)), "its edges cross"),  # a bow tie
        (((0, 0), (1, 1), (2, 2)), "its corners lie on a line"),
        (((0, 0), (0.01, 0), (0.01, 0.01)), "its corners lie on a line"),  # half a square centimetre
    ],
)
def test_an_outline_is_an_area(corners_m: tuple[tuple[float, float], ...], reason: str) -> None:
    """Squares and dents are areas; a bow tie, a line and a slip of the hand are none."""
    assert why_no_area(corners_m).startswith(reason)
    assert bool(why_no_area(corners_m)) is bool(reason)


def test_a_wrong_value_is_shown_and_cut_where_it_is_long() -> None:
    """What a client is told of a file that somebody spoiled is short, whatever is in the file."""
    with pytest.raises(ValueError, match=r"keep_out: .*got 'aaaa") as refused:
        parse_zones(f"keep_out: {'a' * 500_000}", ZONES)
    assert len(str(refused.value)) < 1000
