"""Masters of others drive our robot: vda5050-sdk (Python, 2.1) and vda-5050-lib (JavaScript, 2.0)."""

import asyncio
import json
import os
import time
from pathlib import Path
from typing import Any

import pytest
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.topics import timestamp_of
from vda5050 import MasterClient, MasterConfig
from vda5050.model.common import NodePosition
from vda5050.model.order import Edge, Node, Order
from vda5050_fakes import NAME, FakeRobot
from vda5050_mosquitto import mosquitto, program
from vda5050_online import master, robot_online
from vda5050_orders import HEADER

ROBOT = f"{NAME.manufacturer}/{NAME.serial_number}"
TOOLS = Path(__file__).parents[3] / "build" / "addons-tools" / "node_modules"
SCRIPT = Path(__file__).with_name("vda5050_lib_master.js")


def sdk_node(index: int, *, released: bool = True) -> Node:
    """A node at x = ``index`` metres."""
    position = NodePosition(x=float(index), y=0.0, map_id="flat")
    return Node(
        node_id=f"n{index}", sequence_id=2 * index, released=released, node_position=position, actions=[]
    )


def sdk_edge(index: int, *, released: bool = True) -> Edge:
    """The edge from node ``index`` to the next."""
    return Edge(
        edge_id=f"e{index}",
        sequence_id=2 * index + 1,
        released=released,
        start_node_id=f"n{index}",
        end_node_id=f"n{index + 1}",
        actions=[],
    )


def test_the_python_sdk_drives_our_robot(tmp_path: Path) -> None:
    """Order with a horizon, update, pause, refusal of a second order, cancelling, factsheet: as its own reads it."""

    async def run() -> None:
        async with mosquitto(tmp_path) as broker, master(broker.port) as now:
            robot = FakeRobot(2.0)
            async with robot_online(BrokerParameters("127.0.0.1", broker.port), robot):
                await now.until_state(lambda state: True)
                config = MasterConfig(broker_url=f"mqtt://127.0.0.1:{broker.port}", validate_messages=True)
                async with MasterClient(config) as sdk:
                    await drive_by_sdk(sdk, robot)

    asyncio.run(run())


async def drive_by_sdk(sdk: MasterClient, robot: FakeRobot) -> None:
    """What the SDK's master does, in turn."""
    rejections: list[Any] = []
    sdk.on_vehicle_error(lambda event, key: rejections.append(event))

    async def until(condition: Any) -> Any:
        assert await sdk.wait_for(ROBOT, lambda session: condition(session.state), timeout=100.0)
        return (await sdk.session(ROBOT)).state

    await sdk.request_state(ROBOT)
    await until(lambda state: state is not None)
    fields = {key: value for key, value in HEADER.items() if key != "timestamp"}

    def header() -> dict[str, Any]:
        return fields | {"timestamp": timestamp_of(time.time())}

    nodes = [sdk_node(0), sdk_node(1), sdk_node(2, released=False)]
    edges = [sdk_edge(0), sdk_edge(1, released=False)]
    order = Order(**header(), order_id="o1", order_update_id=0, nodes=nodes, edges=edges)
    assert (await sdk.dispatch(order, ROBOT)).accepted
    await until(lambda state: state.last_node_id == "n1" and not state.driving)
    assert (await sdk.extend_base(ROBOT, [sdk_node(2), sdk_node(3)], [sdk_edge(1), sdk_edge(2)])).accepted
    await until(lambda state: state.last_node_id == "n1" and state.driving)
    await sdk.pause(ROBOT)
    state = await until(lambda state: state.paused and not state.driving)
    await sdk.resume(ROBOT)
    state = await until(lambda state: state.last_node_id == "n3" and not state.node_states)
    assert (state.order_update_id, state.errors) == (1, [])
    await sdk.request_factsheet(ROBOT)
    assert await sdk.wait_for(ROBOT, lambda _: sdk.min_order_interval(ROBOT) == 0.0, timeout=100.0)
    assert rejections == []


def test_the_javascript_library_drives_our_robot(tmp_path: Path) -> None:
    """Its events, in turn: nodes and edges, an update, a refused order, an instant action, the cancelling."""
    node = program("node")
    if not (TOOLS / "vda-5050-lib").is_dir():
        text = "vda-5050-lib is not installed: make addons-tools"
        if os.environ.get("ADDONS_TESTS") == "required":
            pytest.fail(text)
        pytest.skip(text)

    async def run() -> list[str]:
        async with mosquitto(tmp_path) as broker, master(broker.port) as now:
            robot = FakeRobot(2.0)
            async with robot_online(BrokerParameters("127.0.0.1", broker.port), robot, version="2.0.0"):
                await now.until_state(lambda state: True)
                process = await asyncio.create_subprocess_exec(
                    node,
                    str(SCRIPT),
                    str(broker.port),
                    env=os.environ | {"NODE_PATH": str(TOOLS)},
                    stdout=asyncio.subprocess.PIPE,
                    stderr=asyncio.subprocess.PIPE,
                )
                try:
                    out, err = await asyncio.wait_for(process.communicate(), 100.0)
                finally:
                    if process.returncode is None:
                        process.kill()
                        await process.wait()
                assert process.returncode == 0, err.decode()
                events: list[str] = json.loads(out)
                return events

    assert asyncio.run(run()) == [
        "node n0",
        "traversing e0",
        "edge e0",
        "node n1",
        "processed o1/0 active",
        "node n2",
        "processed o1/1",
        "refused o2: noRouteError",
        "say FINISHED",
        "dance FAILED",
        "processed o3/0 cancelled",
        "cancelOrder FINISHED",
    ]
