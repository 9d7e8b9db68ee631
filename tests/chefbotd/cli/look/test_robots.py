"""Robots found by name on the command line; the network is the test's."""

import json

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.client import discovery
from chefbotd.client.announcement import Announcement

KITCHEN = Announcement("kitchen-bot", ("192.168.7.31",), 7333, 7380, "chefbot", "0.1.0")
PAGE_ONLY = Announcement("khan", ("192.168.7.32",), None, 7380, "kh\x1b[2Jan", "0.2.0", encrypted=True)


@pytest.fixture(autouse=True)
def network(monkeypatch: pytest.MonkeyPatch) -> dict[str, Announcement]:
    """Those that answer, by name."""
    there = {each.name: each for each in (KITCHEN, PAGE_ONLY)}

    async def find(name: str) -> Announcement | None:
        return there.get(name)

    async def robots(seconds: float) -> list[Announcement]:
        return list(there.values())

    monkeypatch.setattr(discovery, "find", find)
    monkeypatch.setattr(discovery, "robots", robots)
    return there


def test_the_robots_are_listed_with_socket_and_page():
    """A line each; what came over the network cannot clear the screen."""
    told = CliRunner().invoke(main, ["robots"])
    assert told.exit_code == 0
    assert told.output.splitlines() == [
        "NAME         SOCKET             ROBOT     VERSION  PAGE",
        "kitchen-bot  192.168.7.31:7333  chefbot   0.1.0    http://kitchen-bot.local:7380/",
        "khan         -                  kh?[2Jan  0.2.0    https://khan.local:7380/",
    ]
    (first, second) = json.loads(CliRunner().invoke(main, ["robots", "--json"]).output)
    assert (first["addresses"], first["port"], second["port"]) == (["192.168.7.31"], 7333, None)


def test_where_nobody_is_heard_it_is_said_how_a_robot_would_be(network: dict[str, Announcement]):
    """Standard output is empty, for scripts."""
    network.clear()
    told = CliRunner().invoke(main, ["robots"])
    assert told.exit_code == 0
    assert "[discovery] enabled = true" in told.output


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--robot", "nobody", "status"], Exit.CANNOT_CONNECT, "no robot called 'nobody' answers"),
        (
            ["--robot", "khan", "status"],
            Exit.CANNOT_CONNECT,
            "its socket accepts only clients on its own computer",
        ),
        (["--robot", "khan", "--connect", "127.0.0.1:1", "status"], Exit.USAGE, "exclude each other"),
    ],
)
def test_a_robot_that_cannot_be_reached_is_told(arguments: list[str], code: int, said: str):
    """By its name, and what to do."""
    told = CliRunner().invoke(main, arguments)
    assert told.exit_code == code
    assert said in told.output


def test_a_command_goes_to_the_robot_that_was_named(network: dict[str, Announcement]):
    """Its address is the announced one: here a port of loopback on which nobody listens, and the message names it."""
    network["kitchen-bot"] = Announcement("kitchen-bot", ("127.0.0.1",), 1, None, "chefbot", "0.1.0")
    told = CliRunner().invoke(main, ["--robot", "kitchen-bot", "status"])
    assert told.exit_code == Exit.CANNOT_CONNECT
    assert "cannot connect to 127.0.0.1:1" in told.output
