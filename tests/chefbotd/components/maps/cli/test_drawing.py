"""What commands that draw on a map are given, and what they say."""

from types import SimpleNamespace

import click
import pytest

from chefbotd.components.maps.cli.drawing import pair_points, say_saved, spans_of


def test_numbers_are_points_in_their_order():
    """Two by two; one without its Y is refused, with how many there were."""
    assert pair_points((1.0, -2.0, 3.5, 0.0)) == ((1.0, -2.0), (3.5, 0.0))
    with pytest.raises(click.UsageError, match="an X and a Y for each corner, got 3 numbers"):
        pair_points((1.0, -2.0, 3.5))


def test_an_outline_is_told_by_its_reach():
    """From the least to the largest of each coordinate, in centimetres, in whatever order the points are."""
    assert spans_of(((2.0, -1.5), (-0.254, 4.0), (1.0, 0.0))) == ["-0.25…2.00", "-1.50…4.00"]


@pytest.mark.parametrize(
    ("warning", "said"),
    [
        (None, "It is drawn. Note: thin."),
        ("the worker is away", "It is drawn. But the worker is away. Note: thin."),
    ],
)
def test_what_is_saved_and_not_used_is_told_with_the_reason(
    warning: str | None, said: str, capsys: pytest.CaptureFixture[str]
):
    """The reason stands before the notes; without one nothing is said of it."""
    context = SimpleNamespace(as_json=False)
    say_saved(context, SimpleNamespace(warning=warning), "It is drawn.", " Note: thin.")
    assert " ".join(capsys.readouterr().out.split()) == said
