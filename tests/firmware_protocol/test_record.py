"""The values of this package: what they promise, as frozen dataclasses with slots do."""

import copy
import pickle

import pytest

from firmware_protocol.messages import BoardTime, QuadratureEdges, QuadratureStill, ResetDone

EDGES = QuadratureEdges(2, 70, (1, 3, 2), 5000, (40,))


def test_fields_are_given_by_place_or_by_name() -> None:
    """What has a default may be left out."""
    assert QuadratureEdges(2, 70, states=(1, 3), micros=9) == QuadratureEdges(2, 70, (1, 3), 9, ())
    assert (EDGES.wheel, EDGES.total, EDGES.states, EDGES.micros, EDGES.gaps_us) == (
        2,
        70,
        (1, 3, 2),
        5000,
        (40,),
    )


@pytest.mark.parametrize(
    ("values", "named"),
    [((), {}), ((1,), {}), ((1, 2, 3), {}), ((1,), {"micros": 1, "cycle_s": 2}), ((1, 2), {"x": 3})],
)
def test_fields_that_are_missing_or_too_many_are_refused(
    values: tuple[int, ...], named: dict[str, int]
) -> None:
    """The error names the class, its fields and what was given."""
    with pytest.raises(TypeError, match=r"BoardTime takes \('micros', 'cycle_s'\), got"):
        BoardTime(*values, **named)


def test_values_are_equal_by_class_and_fields() -> None:
    """Two classes with equal fields are different, and so are their hashes."""
    assert BoardTime(1, 2.0) == BoardTime(1, 2.0)
    assert BoardTime(1, 2.0) != BoardTime(1, 3.0)
    assert BoardTime(1, 2) != QuadratureStill(1, 2)
    assert len({BoardTime(1, 2), BoardTime(1, 2.0), QuadratureStill(1, 2), ResetDone(), ResetDone()}) == 3


def test_a_value_never_changes() -> None:
    """Neither is a field set or deleted, nor is another one added."""
    moment = BoardTime(1, 2.0)
    with pytest.raises(AttributeError, match="BoardTime never changes, nor does its 'micros'"):
        moment.micros = 3  # type: ignore[misc]
    with pytest.raises(AttributeError, match="never changes"):
        del moment.micros
    with pytest.raises(AttributeError, match="never changes"):
        moment.other = 3  # type: ignore[attr-defined]
    assert not hasattr(moment, "__dict__")


def test_a_value_is_shown_copied_and_pickled_with_its_fields() -> None:
    """``repr`` is what makes it again."""
    assert repr(EDGES) == "QuadratureEdges(wheel=2, total=70, states=(1, 3, 2), micros=5000, gaps_us=(40,))"
    assert copy.copy(EDGES) == pickle.loads(pickle.dumps(EDGES)) == EDGES
