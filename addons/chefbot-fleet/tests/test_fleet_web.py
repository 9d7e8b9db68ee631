"""Who may ask the manager's page for what, and how the program guards it and the broker's connection."""

import asyncio
import io
import ssl
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trustme
from aiohttp.test_utils import TestClient, TestServer
from chefbot_fleet import cli
from chefbot_fleet.cli import main
from chefbot_fleet.fleet import Fleet
from chefbot_fleet.lanes import find_lanes
from chefbot_fleet.manager import Manager
from chefbot_fleet.records import FleetParameters
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Store
from chefbot_fleet.view import roadmap_view
from chefbot_fleet.walls import SHADED, walls_of
from chefbot_fleet.web import FleetPage
from chefbot_vda5050.broker import BrokerParameters
from click.testing import CliRunner, Result
from fleet_world import HOMES, small_roadmap, write_map
from PIL import Image

from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

TOKEN = "a token for tests"
ORDER = {"id": "a", "pick": "counter", "drop": "table"}


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    """Without robots."""
    store = Store(tmp_path / "orders.db")
    return Fleet(small_roadmap(), HOMES, store, Pace(0.5, 0.0), FleetParameters("map"), 0.0)


class Started:
    """What the program would have run: the connection, and where the page would listen."""

    def __init__(self) -> None:
        self.broker: BrokerParameters | None = None
        self.at: tuple[Any, ...] = ()


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Started:
    """The manager notes how it is started, and ends."""
    noted = Started()
    begin = Manager.__init__

    def create(self: Manager, fleet: Fleet, broker: BrokerParameters, *clock: Any, **options: Any) -> None:
        noted.broker = broker
        begin(self, fleet, broker, *clock, **options)

    async def run(self: Manager, *where: Any) -> None:
        noted.at = where[-3:]

    monkeypatch.setattr(Manager, "__init__", create)
    monkeypatch.setattr(Manager, "run", run)
    return noted


def program(folder: Path, *words: str, files_as_they_are: bool = False) -> Result:
    """``chefbot-fleet run`` with these words more."""
    if not files_as_they_are:
        write_map(folder)
    files = (str(folder / "map.yaml"), str(folder / "places.yaml"))
    database = ("--database", str(folder / "fleet.db"), "--robots", "2")
    return CliRunner().invoke(main, ["run", *files, "127.0.0.1", *database, *words])


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 147472\n"


@pytest.mark.parametrize(
    ("file", "content", "said"),
    [
        ("map.yaml", b"image: [", "map.yaml: not valid YAML"),
        ("map.yaml", b"image: map.pgm\n", "map.yaml: resolution: Field required"),
        ("map.yaml", b"\x93\x00", "map.yaml: "),
        ("map.yaml", POINTER, "map.yaml: is only a pointer of Git LFS"),
        ("map.pgm", POINTER, "map.pgm: is only a pointer of Git LFS"),
        ("map.pgm", b"P5\n3 3\n255\n12", "map.pgm: cannot be read as an image"),
        ("map.pgm", b"P5\n2 2\n255\n\0\0\0\0", "map.yaml: the map has no free space for a robot"),
        ("places.yaml", b"a: [1", "places.yaml: not valid YAML"),
        ("places.yaml", b"a: 1", "places.yaml: expected names with a position each"),
        ("places.yaml", b"", "places.yaml: expected names with a position each"),
        ("places.yaml", b"a: [x, 1]", "places.yaml: expected names with a position each"),
        ("places.yaml", b"\xff\xfe\x93", "places.yaml: expected names with a position each"),
        ("places.yaml", b"far: [99, 99]", "places.yaml: far: the robot has not its clearance there"),
    ],
)
def test_a_file_that_is_no_map_or_no_places_ends_in_a_sentence(
    tmp_path: Path, started: Started, file: str, content: bytes, said: str
) -> None:
    """Exit code 1, the file's name and what is wrong; no traceback, and nothing is started."""
    write_map(tmp_path)
    (tmp_path / file).write_bytes(content)
    result = program(tmp_path, files_as_they_are=True)
    assert (result.exit_code, isinstance(result.exception, SystemExit)) == (1, True)
    assert result.stderr.startswith("Error: ") or "\nError: " in result.stderr
    assert said in result.stderr
    assert not started.at


def test_an_image_that_is_missing_is_named(tmp_path: Path, started: Started) -> None:
    """As above: the YAML may have been copied without it."""
    write_map(tmp_path)
    (tmp_path / "map.pgm").unlink()
    result = program(tmp_path, files_as_they_are=True)
    assert (result.exit_code, "map.pgm: cannot be read: No such file" in result.stderr) == (1, True)


def test_the_search_for_lanes_says_that_it_is_at_work(
    tmp_path: Path, started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At once with the map's size, again and again while it goes on, and in the end how long it took."""
    goes_on = threading.Event()
    echo = cli.click.echo

    def note(text: str, err: bool = False) -> None:
        echo(text, err=err)
        if text.startswith("still "):
            goes_on.set()

    def find_slowly(*parts: Any) -> Any:
        assert goes_on.wait(30)
        return find_lanes(*parts)

    monkeypatch.setattr(cli, "REPEAT_S", 0.01)
    monkeypatch.setattr(cli, "find_lanes", find_slowly)
    monkeypatch.setattr(cli.click, "echo", note)
    result = program(tmp_path)
    assert result.exit_code == 0
    lines = [line for line in result.stderr.splitlines() if "lanes" in line or "found" in line]
    assert lines[0].startswith("looking for lanes and homes in map.yaml, ")
    assert lines[1].startswith("still looking for lanes")
    assert lines[-1].startswith("found them in ")


def ask(page: FleetPage, requests: Sequence[tuple[str, str, dict[str, str]]]) -> list[int]:
    """The statuses of requests, each with method, path and headers."""

    async def scenario() -> list[int]:
        async with TestClient(TestServer(page.application())) as client:
            answers = [
                await client.request(method, path, headers=headers, json=ORDER)
                for method, path, headers in requests
            ]
            return [answer.status for answer in answers]

    return asyncio.run(scenario())


def test_an_empty_token_opens_nothing(fleet: Fleet, tmp_path: Path, started: Started) -> None:
    """Neither the page nor the program takes one: a request without a token would have it."""
    with pytest.raises(ValueError, match="expected a token"):
        FleetPage(fleet, "", lambda: 0.0)
    (tmp_path / "token").write_text("\n")
    result = program(tmp_path, "--token-file", str(tmp_path / "token"))
    assert result.exit_code == 2
    assert "is empty: expected a token" in result.output
    assert not started.at


def test_a_command_needs_the_token_and_looking_does_not(fleet: Fleet) -> None:
    """No header, an empty one and a wrong one are refused, and give no order."""
    page = FleetPage(fleet, TOKEN, lambda: 0.0)
    path = "/api/orders"
    headers: list[dict[str, str]] = [{}, {"Authorization": ""}, {"Authorization": "Bearer a"}]
    assert ask(page, [("POST", path, one) for one in headers]) == [401, 401, 401]
    assert not fleet.orders
    right = {"Authorization": f"Bearer {TOKEN}"}
    assert ask(page, [("POST", path, right), ("GET", "/api/fleet", {})]) == [200, 200]
    assert set(fleet.orders) == {"a"}


def test_a_name_that_is_not_this_computers_is_refused(fleet: Fleet) -> None:
    """A page elsewhere can have its own name lead here (DNS rebinding); it cannot choose the header Host."""
    page = FleetPage(fleet, TOKEN, lambda: 0.0, ["kitchen.local"])
    right = {"Authorization": f"Bearer {TOKEN}"}
    odd: list[tuple[str, str, dict[str, str]]] = [
        ("GET", "/api/fleet", {"Host": "elsewhere.example:7340"}),
        ("GET", "/metrics", {"Host": "kitchen.local.example"}),
        ("POST", "/api/orders", {"Host": "elsewhere.example", **right}),
    ]
    assert ask(page, odd) == [421, 421, 421]
    assert not fleet.orders
    own = ("127.0.0.1:7340", "[::1]:7340", "localhost:7340", "kitchen.local:7340")
    assert ask(page, [("GET", "/api/fleet", {"Host": host}) for host in own]) == [200, 200, 200, 200]


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "robot.local"])
def test_beyond_this_computer_the_page_needs_a_certificate(
    host: str, tmp_path: Path, started: Started
) -> None:
    """Over plain HTTP the token could be overheard; on this computer nobody can."""
    result = program(tmp_path, "--host", host)
    assert result.exit_code == 2
    assert "needs --page-certificate" in result.output
    assert not started.at
    assert program(tmp_path).exit_code == 0
    assert started.at == ("127.0.0.1", 7340, None)


def test_a_certificate_encrypts_the_page(fleet: Fleet, tmp_path: Path, started: Started) -> None:
    """A client that trusts its authority reads it."""
    authority, trusting = trustme.CA(), ssl.create_default_context()
    authority.configure_trust(trusting)
    file = tmp_path / "page.pem"
    authority.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(file)
    assert program(tmp_path, "--host", "0.0.0.0", "--page-certificate", str(file)).exit_code == 0
    host, _, tls = started.at
    assert host == "0.0.0.0"

    async def scenario() -> int:
        server = TestServer(FleetPage(fleet, TOKEN, lambda: 0.0).application(), scheme="https")
        await server.start_server(ssl=tls)
        try:
            async with TestClient(server) as client:
                return (await client.get("/api/fleet", ssl=trusting)).status
        finally:
            await server.close()

    assert asyncio.run(scenario()) == 200


def test_the_connection_to_the_broker_is_encrypted_where_that_was_asked_for(
    tmp_path: Path, started: Started
) -> None:
    """By the system's authorities or another one, at MQTT's port for it; without, neither."""
    assert program(tmp_path).exit_code == 0
    assert started.broker == BrokerParameters("127.0.0.1", 1883)
    file = tmp_path / "authority.pem"
    trustme.CA().cert_pem.write_to_path(file)
    for words in (("--tls",), ("--cafile", str(file))):
        assert program(tmp_path, *words).exit_code == 0
        broker = started.broker
        assert broker is not None
        assert broker.port == 8883
        assert broker.tls is not None
        assert broker.tls.verify_mode is ssl.CERT_REQUIRED


def test_the_page_has_a_picture_of_the_walls(fleet: Fleet) -> None:
    """Two walls, free floor and what nobody has seen, with the y axis up, where the map lies; Pillow reads it."""
    percent = np.full((2, 3), FREE, np.int8)
    percent[0, 0] = percent[1, 2] = OCCUPIED
    percent[1, 0] = UNKNOWN
    walls = walls_of(OccupancyGrid(0.5, Pose2D(-1.0, 2.0, 0.0), percent))
    assert walls is not None
    alpha = np.asarray(Image.open(io.BytesIO(walls.png)).convert("LA"))[..., 1]
    assert alpha.tolist() == [[SHADED, 0, 255], [255, 0, 0]]
    view = roadmap_view(fleet, walls)
    assert view["walls"] == [-1.0, 2.0, 1.5, 1.0]

    async def picture(page: FleetPage) -> tuple[int, str, bytes]:
        async with TestClient(TestServer(page.application())) as client:
            answer = await client.get("/walls.png")
            return answer.status, answer.content_type, await answer.read()

    page = FleetPage(fleet, TOKEN, lambda: 0.0, walls=walls)
    assert asyncio.run(picture(page)) == (200, "image/png", walls.png)
    assert asyncio.run(picture(FleetPage(fleet, TOKEN, lambda: 0.0)))[0] == 404
    assert walls_of(OccupancyGrid(0.5, Pose2D(0.0, 0.0, 0.1), percent)) is None


def test_an_order_without_a_name_or_with_a_novel_for_one_is_refused(fleet: Fleet) -> None:
    """It goes into messages, questions and the page."""

    async def give(identifier: str) -> int:
        page = FleetPage(fleet, TOKEN, lambda: 0.0)
        async with TestClient(TestServer(page.application())) as client:
            headers = {"Authorization": f"Bearer {TOKEN}"}
            answer = await client.post("/api/orders", headers=headers, json={**ORDER, "id": identifier})
            return answer.status

    assert asyncio.run(give("")) == asyncio.run(give("a" * 101)) == 400
    assert asyncio.run(give("a" * 100)) == 200


def test_an_order_is_cancelled_with_the_token_and_unknown_ones_are_refused(fleet: Fleet) -> None:
    """The answer is the order; without the token nothing changes."""
    page = FleetPage(fleet, TOKEN, lambda: 0.0)
    fleet.add_order("a", "counter", "table", 0.0)
    right = {"Authorization": f"Bearer {TOKEN}"}

    async def scenario() -> list[tuple[int, Any]]:
        async with TestClient(TestServer(page.application())) as client:
            answers = []
            for name, headers in (("a", {}), ("b", right), ("a", right), ("a", right)):
                answer = await client.post("/api/orders/cancel", headers=headers, json={"id": name})
                answers.append((answer.status, await answer.json()))
            return answers

    answers = asyncio.run(scenario())
    assert [status for status, _ in answers] == [401, 400, 200, 200]
    assert answers[1][1] == {"error": "there is no order 'b'"}
    assert [answer["stage"] for _, answer in answers[2:]] == ["cancelled", "cancelled"]
