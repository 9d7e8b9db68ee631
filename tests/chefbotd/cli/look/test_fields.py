"""What ``watch`` prints of an event."""

import pytest

from chefbotd.cli.common.exits import ProgramError
from chefbotd.cli.look.commands import select

CAPABILITIES = ("method.drive", "topic.odometry", "feature.roles", "topic.wheels")
WHEELS = {"name": ["left", "right"], "duty": [50, -7]}


def test_fields_of_a_topic_are_printed_by_the_names_that_were_asked_for() -> None:
    """In the order of the words; lists by their index, from 0."""
    selection = select(["wheels.duty.1", "odometry.x_m", "wheels.name"], ())
    assert selection.topics == ("wheels", "odometry")
    assert list(selection.of("wheels", WHEELS).items()) == [("duty.1", -7), ("name", ["left", "right"])]
    assert selection.of("odometry", {"x_m": 0.25, "y_m": 1.0}) == {"x_m": 0.25}


@pytest.mark.parametrize("words", [["wheels", "wheels.duty"], ["wheels.duty", "wheels"]])
def test_a_whole_topic_includes_its_fields(words: list[str]) -> None:
    """In whatever order they come."""
    assert select(words, ()).of("wheels", WHEELS) == WHEELS


def test_all_is_every_topic_that_the_daemon_has() -> None:
    """Its methods and features are none."""
    assert select(["all"], CAPABILITIES).topics == ("odometry", "wheels")


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("wheels.dutty", "wheels has no field 'dutty': at 'dutty' there is name, duty"),
        ("wheels.duty.2", "wheels has no field 'duty.2': at '2' there is 0, 1"),
        ("wheels.duty.1.x", "wheels has no field 'duty.1.x': at 'x' there is nothing inside it"),
    ],
)
def test_a_field_that_is_not_there_is_refused_with_those_that_are(word: str, told: str) -> None:
    """The message names the part of the path that fails."""
    with pytest.raises(ProgramError) as refused:
        select([word], ()).of("wheels", WHEELS)
    assert str(refused.value) == told
