"""Recorded input brings out the recorded events and commands, to the last digit."""

import pytest

from tests.scenarios import golden


@pytest.mark.parametrize("name", golden.STORIES)
def test_the_same_input_brings_out_the_same_events_and_commands(name: str):
    """Every event, every line sent and their order are as recorded; a difference is a change of behaviour."""
    steps, expected = golden.read(name)
    assert golden.replay(golden.STORIES[name], steps) == expected


@pytest.mark.parametrize("name", golden.STORIES)
def test_the_recorded_inputs_are_those_of_the_simulated_robot(name: str):
    """The pairs tell a story that still happens: they hold motion, and end with a stop."""
    steps, expected = golden.read(name)
    assert any(step.kind == "call" for step in steps)
    stop = "s" + " 0" * len(golden.STORIES[name].settings().chassis.wheels)
    assert any("> b's " in line and f"> b'{stop}" not in line for line in expected)
    assert [line for line in expected if " > " in line][-1].endswith(4 * rf"{stop}\r" + "'")


def test_the_inputs_can_be_recorded_anew():
    """What goes into a daemon is noted as lines that are read back as the same steps."""
    steps = golden.record(golden.STORIES["khan"])
    assert {step.kind for step in steps} == {"board", "call"}
    lines = [step.dump() for step in steps]
    assert [golden.Step.parse(line).dump() for line in lines] == lines
