"""The manager's program on a real broker, with robots by others (PyPI: vda5050-sdk)."""

import asyncio
import contextlib
import json
import os
import shutil
import signal
import sys
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from fleet_world import write_map

from chefbotd.transport.ports import reserve_port

sdk = pytest.importorskip("vda5050.client.agv.client")

PATH = f"{os.environ.get('PATH', '')}:/usr/sbin"
TOKEN = "a token for tests"


async def until(condition: Callable[[], bool]) -> None:
    """Wait for something; the end is generous, and only for what never comes."""
    async with asyncio.timeout(100.0):
        while not condition():  # noqa: ASYNC110 - it is another process's
            await asyncio.sleep(0.05)


@contextlib.asynccontextmanager
async def program(*words: str, ready_port: int) -> AsyncIterator[asyncio.subprocess.Process]:
    """A program that listens, and that is gone at the end."""
    process = await asyncio.create_subprocess_exec(
        *words, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL
    )
    try:
        async with asyncio.timeout(100.0):
            while True:
                with contextlib.suppress(OSError):
                    _, writer = await asyncio.open_connection("127.0.0.1", ready_port)
                    writer.close()
                    break
                assert process.returncode is None, f"{words[0]} ended with {process.returncode}"
                await asyncio.sleep(0.05)
        yield process
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGKILL)
            await process.wait()


@contextlib.asynccontextmanager
async def mosquitto(folder: Path) -> AsyncIterator[int]:
    """A broker of one's own; its port."""
    path = shutil.which("mosquitto", path=PATH)
    if path is None:
        if os.environ.get("ADDONS_TESTS") == "required":
            pytest.fail("mosquitto is not installed: make addons-tools")
        pytest.skip("mosquitto is not installed")
    port = reserve_port()
    (folder / "mosquitto.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    async with program(path, "-c", str(folder / "mosquitto.conf"), ready_port=port):
        yield port


class OthersRobot:
    """A robot of vda5050-sdk: its own messages, its own acceptance of orders, its own execution."""

    def __init__(self, serial: str, broker_port: int, point: tuple[float, float]) -> None:
        from vda5050.adapters.mqtt.transport import AiomqttTransport
        from vda5050.config import VehicleConfig

        url = f"mqtt://127.0.0.1:{broker_port}"
        config = VehicleConfig(
            broker_url=url, manufacturer="others", serial_number=serial, state_interval=0.5
        )
        self._point = point
        self._orders: asyncio.Queue[Any] = asyncio.Queue()
        self.client = sdk.VehicleClient(config, transport=AiomqttTransport(url, client_id=serial))
        self.client.on_order(self._orders.put_nowait)
        self.worked: list[str] = []

    async def run(self) -> None:
        """Report, and execute one order after the other."""
        from vda5050.client.agv.executor import OrderExecutor

        await self.client.connect()
        executor = OrderExecutor(self.client.publisher, node_delay=0.05, action_delay=0.2)
        x_m, y_m = self._point
        self.client.publisher.update_position(x=x_m, y=y_m, theta=0.0, map_id="map")
        await self.client.publish_state()
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._report())
            while True:
                order = await self._orders.get()
                await executor.run(order)
                self.worked += [action.action_id for node in order.nodes for action in node.actions]
                await self.client.publish_state()

    async def _report(self) -> None:
        while True:
            await asyncio.sleep(0.3)
            await self.client.publish_state()


class Requests:
    """The manager's HTTP."""

    def __init__(self, port: int) -> None:
        self._base = f"http://127.0.0.1:{port}"

    def get(self, path: str) -> bytes:
        """What is there."""
        with urllib.request.urlopen(self._base + path) as answer:
            return bytes(answer.read())

    def post(self, path: str, body: object, token: str = TOKEN) -> tuple[int, Any]:
        """Status and answer of a command."""
        request = urllib.request.Request(
            self._base + path, json.dumps(body).encode(), {"Authorization": f"Bearer {token}"}
        )
        try:
            with urllib.request.urlopen(request) as answer:
                return answer.status, json.loads(answer.read())
        except urllib.error.HTTPError as error:
            with error:
                return error.code, json.loads(error.read())

    def fleet(self) -> dict[str, Any]:
        """What the page shows."""
        result: dict[str, Any] = json.loads(self.get("/api/fleet"))
        return result

    def done(self) -> int:
        """How many orders are done."""
        return int(self.fleet()["done"])


async def everything(folder: Path) -> None:
    """Orders over HTTP; the manager is killed with SIGKILL in the middle, and started again."""
    write_map(folder)
    (folder / "token").write_text(TOKEN)
    async with mosquitto(folder) as broker_port:
        page_port = reserve_port()
        requests = Requests(page_port)
        command = (
            sys.executable, "-c", "from chefbot_fleet.cli import main; main()", "run",
            str(folder / "map.yaml"), str(folder / "places.yaml"), f"127.0.0.1:{broker_port}",
            "--database", str(folder / "fleet.db"), "--port", str(page_port), "--robots", "3",
            "--token-file", str(folder / "token"), "--speed-m-s", "5",
        )  # fmt: skip
        robots = [OthersRobot("a", broker_port, (3.0, 1.7)), OthersRobot("b", broker_port, (6.0, 1.7))]
        driving = [asyncio.create_task(robot.run()) for robot in robots]
        try:
            async with program(*command, ready_port=page_port):
                await until(lambda: len(requests.fleet()["robots"]) == 2)
                assert (
                    requests.post("/api/orders", {"id": "x", "pick": "counter", "drop": "table"}, "no")[0]
                    == 401
                )
                assert requests.post("/api/orders", {"id": "x", "pick": "counter", "drop": "moon"})[0] == 400
                for k in range(6):
                    places = ("counter", "table") if k % 2 else ("table", "counter")
                    body = {"id": f"o{k}", "pick": places[0], "drop": places[1]}
                    for _ in range(2):
                        assert requests.post("/api/orders", body)[0] == 200
                assert b"<title>Fleet</title>" in requests.get("/")
                await until(lambda: requests.done() >= 2)
            async with program(*command, ready_port=page_port):
                await until(lambda: requests.done() == 6)
                text = requests.get("/metrics").decode()
                assert 'chefbot_fleet_orders{stage="done"} 6.0' in text
                fleet = requests.fleet()
                assert {order["id"] for order in fleet["orders"]} == {f"o{k}" for k in range(6)}
        finally:
            left = set(driving)
            while left:  # the executor of others takes a cancellation for the end of its order
                for task in left:
                    task.cancel()
                _, left = await asyncio.wait(left, timeout=0.5)
            await asyncio.gather(*driving, return_exceptions=True)
    work = sorted(action_id.rsplit("-", 1)[0] for robot in robots for action_id in robot.worked)
    assert work == sorted(f"o{k}-{stage}" for k in range(6) for stage in (0, 1))


@pytest.mark.realtime
def test_robots_by_others_bring_every_order_once_though_the_manager_is_killed(tmp_path: Path) -> None:
    """Six orders, each sent twice; every pick and every drop is done once by one robot."""
    asyncio.run(everything(tmp_path))
