"""chefbotctl map start, pause, finish and discard: what is asked of the daemon, and what people and scripts read."""

import json

import pytest

from chefbotd.cli.common.exits import Exit
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control


@pytest.mark.parametrize(
    ("arguments", "called", "said"),
    [
        (
            ["start"],
            ("start_mapping", {"unfinished": False}),
            "Mapping: 40 scans so far. 'chefbotctl map live' shows the map.",
        ),
        (
            ["start", "flat"],
            ("start_mapping", {"name": "flat", "unfinished": False}),
            "Mapping: 40 scans so far.",
        ),
        (["start", "--unfinished"], ("start_mapping", {"unfinished": True}), "Mapping: 40 scans so far."),
        (["pause"], ("pause_mapping", {}), "Paused, with 40 scans."),
        (
            ["finish", "flat"],
            ("finish_mapping", {"name": "flat"}),
            "Saved flat, version 3: 40 scans on 12 m.",
        ),
        (["discard", "--yes"], ("discard_mapping", {}), "The map is discarded."),
    ],
)
def test_each_command_asks_for_one_thing(
    daemon: FakeDaemon, control: Control, arguments: list[str], called: tuple[object, ...], said: str
) -> None:
    """The method is called with these parameters, and a sentence says what came of it."""
    result = control("map", *arguments)
    assert result.exit_code == 0, result.output
    assert called in [(method, params) for _, method, params in daemon.calls]
    assert said in result.output


@pytest.mark.parametrize(
    ("arguments", "key", "value"), [(["finish", "flat"], "version", 3), (["pause"], "state", "paused")]
)
def test_scripts_read_json(control: Control, arguments: list[str], key: str, value: object) -> None:
    """One object with the result's fields."""
    assert json.loads(control("map", *arguments, "--json").output)[key] == value


def test_discarding_is_asked_about(daemon: FakeDaemon, control: Control) -> None:
    """Without --yes, and without an answer, nothing is forgotten."""
    assert control("map", "discard").exit_code != 0
    assert "discard_mapping" not in [method for _, method, _ in daemon.calls]


def test_a_robot_without_a_lidar_says_so(mapctl: Control) -> None:
    """The refusal names what is missing in the configuration."""
    result = mapctl("map", "start")
    assert result.exit_code == Exit.REFUSED
    assert "[[lidar]]" in result.output
