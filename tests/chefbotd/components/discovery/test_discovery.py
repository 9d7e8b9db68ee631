"""A robot that says on the network what it is called, and is found by it."""

import asyncio
import uuid
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

import pytest
import structlog

from chefbotd import __version__
from chefbotd.client import discovery
from chefbotd.client.announcement import Announcement, read
from chefbotd.client.discovery import find, robots
from chefbotd.clock import ManualClock, run_virtual
from chefbotd.components.discovery.parameters import DiscoveryParameters
from chefbotd.components.discovery.service import DiscoveryService, Multicast, NameTaken
from chefbotd.process.build import build
from chefbotd.settings import load
from tests.waiting import PATIENCE_S

LOOPBACK = ["127.0.0.1"]
ANY, HERE, LAN = "0.0.0.0", "127.0.0.1", "192.168.7.31"


@dataclass
class Network:
    """Remembers what was said; ``refusals`` are raised first, one each time."""

    refusals: list[Exception] = field(default_factory=list)
    said: list[Announcement] = field(default_factory=list)
    withdrawn: int = 0

    async def announce(self, announcement: Announcement) -> None:
        """Say it, or refuse."""
        if self.refusals:
            raise self.refusals.pop(0)
        self.said.append(announcement)

    async def withdraw(self) -> None:
        """Count it."""
        self.withdrawn += 1


def listening(host: str, port: int) -> Callable[[], Awaitable[tuple[str, int]]]:
    """A server there."""

    async def address() -> tuple[str, int]:
        return host, port

    return address


def run(network: Network, server: str, page: str | None, seconds: float = 1.0) -> list[str]:
    """Run the service for so long on the virtual clock; what it logs."""

    async def scenario() -> None:
        web = None if page is None else listening(page, 7380)
        service = DiscoveryService(
            "kitchen-bot", "chefbot", listening(server, 7333), web, network, encrypted=False
        )
        running = asyncio.create_task(service.run())
        await asyncio.sleep(seconds)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    with structlog.testing.capture_logs() as logged:
        run_virtual(scenario())
    return [entry["event"] for entry in logged]


@pytest.mark.parametrize(
    ("server", "page", "addresses", "port", "page_port"),
    [
        pytest.param(LAN, None, (LAN,), 7333, None, id="a socket, no page"),
        pytest.param(ANY, ANY, (), 7333, 7380, id="both on every address"),
        pytest.param(HERE, LAN, (LAN,), None, 7380, id="only the page is for others"),
        pytest.param(LAN, HERE, (LAN,), 7333, None, id="only the socket is for others"),
    ],
)
def test_what_others_reach_is_announced(
    server: str, page: str | None, addresses: tuple[str, ...], port: int | None, page_port: int | None
):
    """Name, robot and version, the ports that others reach and no other, and it is taken back at the end."""
    network = Network()
    run(network, server, page)
    assert network.said == [Announcement("kitchen-bot", addresses, port, page_port, "chefbot", __version__)]
    assert network.withdrawn == 1


@pytest.mark.parametrize("page", [None, HERE])
def test_a_robot_that_only_its_own_computer_reaches_is_not_announced_and_says_so(page: str | None):
    """Nothing goes out, and the log says why."""
    network = Network()
    assert run(network, HERE, page) == ["the robot is not announced: only this computer reaches its sockets"]
    assert not network.said


def test_a_name_that_another_one_has_is_told_and_tried_again():
    """Twice it is taken, a minute apart; then the other one is gone."""
    network = Network([NameTaken("kitchen-bot"), NameTaken("kitchen-bot")])
    told = run(network, LAN, None, seconds=121.0)
    assert told == ["the robot is not announced: another one on the network has its name"] * 2 + ["announced"]
    assert len(network.said) == 1


def test_a_network_that_is_not_there_yet_is_waited_for():
    """A computer that boots faster than its wireless network."""
    network = Network([OSError("this computer has no address on a network")])
    told = run(network, ANY, None, seconds=61.0)
    assert told == ["the robot cannot be announced", "announced"]


@pytest.mark.parametrize(
    ("configured", "robot", "label"),
    [
        ("kitchen-bot", "chefbot", "kitchen-bot"),
        (None, "Kitchen bot No. 2", "kitchen-bot-no-2"),
        (None, "机", "chefbot"),
    ],
)
def test_the_name_on_the_network_is_a_hosts_name(configured: str | None, robot: str, label: str):
    """The configured one, or else the robot's with what a host's name may not hold replaced."""
    assert DiscoveryParameters(name=configured).label(robot) == label


@pytest.mark.parametrize("name", ["kitchen bot", "-bot", "a.b", "x" * 64, ""])
def test_a_name_that_no_host_may_have_is_refused(name: str):
    """With what was expected."""
    with pytest.raises(ValueError, match="letters, digits and hyphens"):
        DiscoveryParameters(name=name)


def test_what_somebody_else_announces_may_be_anything():
    """Bytes that are no text, a port that is no number, and nothing at all."""
    found = read("x._chefbotd._tcp.local.", (LAN,), 0, {b"page": b"\xff9", b"robot": None, b"tls": b"yes"})
    assert found == Announcement("x", (LAN,), None, None, "", "")


@pytest.mark.slow
@pytest.mark.realtime
def test_a_robot_is_found_by_its_name_in_any_case_and_no_second_one_gets_it(monkeypatch: pytest.MonkeyPatch):
    """With the library, on loopback alone: announced, listed, found; after the goodbye it is gone."""
    monkeypatch.setattr(discovery, "ANSWER_S", PATIENCE_S)
    name = f"bot-{uuid.uuid4().hex}"  # others may run this test on the same network
    mine = Announcement(name, ("127.0.0.1",), 7334, 7381, "khan", "0.3.1", encrypted=True)

    async def scenario() -> None:
        network, other = Multicast(LOOPBACK), Multicast(LOOPBACK, conflict_s=PATIENCE_S)
        await network.announce(mine)
        try:
            assert await find(name.upper(), PATIENCE_S, LOOPBACK) is not None
            assert mine in await robots(PATIENCE_S, LOOPBACK, expected=[name])
            with pytest.raises(NameTaken):
                await other.announce(mine)
        finally:
            await other.withdraw()
            await network.withdraw()
        assert await find(name, 0.5, LOOPBACK) is None

    asyncio.run(scenario())


@pytest.mark.parametrize("enabled", [True, False])
def test_the_page_may_be_opened_by_the_robots_name(enabled: bool):
    """With discovery NAME.local is one of the page's hosts; without it that name is as foreign as any."""
    overrides: dict[str, object] = {
        "page.enabled": True,
        "discovery.enabled": enabled,
        "discovery.name": "Kitchen-bot",
    }
    daemon = build(load(overrides=overrides), clock=ManualClock())
    assert daemon.page is not None
    hosts = daemon.page._parameters.allowed_hosts
    assert ("kitchen-bot.local" in hosts) is enabled
    assert ("discovery" in [feature.name for feature in daemon.features]) is enabled
