"""rosbridge, spoken by roslib and roslibpy, and by hand where they cannot be made to."""

import asyncio
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from test_node import SOURCE, until_moving
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client

HERE = Path(__file__).parent / "roslib"
ROSLIB = Path(os.environ.get("ROSLIB", Path(__file__).parents[3] / "build" / "roslib"))
PATIENCE_S = 100.0
AHEAD = {"linear": {"x": 0.2}, "angular": {"z": 0.1}}


PRIORITY = """
import os, sys
from chefbot_ros2.rosbridge import server
server.asyncio.run = lambda serving: (serving.close(), print(os.getpriority(os.PRIO_PROCESS, 0)))
server.main()
"""
ALLOWED = (
    "from chefbotd.process.watchdog import raise_priority; print(raise_priority(0, lock_memory=False).nice)"
)


def test_it_serves_with_the_priority_that_the_computer_allows() -> None:
    """The one that the daemon itself would get without real time: a busy computer keeps no stop waiting."""
    serving, allowed = (
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S, check=True
        )
        for program in (PRIORITY, ALLOWED)
    )
    assert serving.stdout == allowed.stdout != ""


@asynccontextmanager
async def rosbridge(port: int, *words: str) -> AsyncIterator[str]:
    """``chefbot-rosbridge``, for the daemon behind a port; its URL. It is to end without an error."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "chefbot_ros2.rosbridge.server", "--connect", f"127.0.0.1:{port}", "--port", "0",
        *words, stdout=PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        line = await asyncio.wait_for(process.stdout.readline(), PATIENCE_S)
        url = re.search(rb"ws://[\d.]+:\d+", line)
        assert url is not None, line
        yield url[0].decode()
        assert process.returncode is None
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGINT)
        code = await asyncio.wait_for(process.wait(), PATIENCE_S)
    assert code == 0


@asynccontextmanager
async def system(folder: Path, tokens: str = "", *words: str) -> AsyncIterator[tuple[int, str]]:
    """A daemon on a simulated robot, and rosbridge: the daemon's port, and the URL."""
    environment = {"CHEFBOTD_MAPS__FOLDER": str(folder), **SOURCE}
    if tokens:
        path = folder / "tokens"
        path.write_text(tokens)
        path.chmod(0o600)
        environment["CHEFBOTD_API__TOKEN_FILE"] = str(path)
    async with (
        simulated_daemon("chefbot", environment) as (where, _),
        rosbridge(where.port, *words) as url,
    ):
        yield where.port, url


async def send(socket: ClientConnection, **words: Any) -> None:
    """An operation."""
    await socket.send(json.dumps(words))


async def until(socket: ClientConnection, **words: Any) -> dict[str, Any]:
    """The first message with these members."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            message: dict[str, Any] = json.loads(await socket.recv())
            if words.items() <= message.items():
                return message


async def call(socket: ClientConnection, service: str) -> Any:
    """A service's answer."""
    await send(socket, op="call_service", service=service)
    return (await until(socket, op="service_response", service=service))["values"]


@asynccontextmanager
async def repeating(socket: ClientConnection) -> AsyncIterator[None]:
    """A velocity at 20 Hz, while the block runs."""

    async def repeat() -> None:
        while True:
            await send(socket, op="publish", topic="/cmd_vel", msg=AHEAD)
            await asyncio.sleep(0.05)

    task = asyncio.create_task(repeat())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def program(library: str) -> list[str]:
    """The command that drives the robot by that library. Node looks for packages beside a program, so it goes there."""
    if library == "roslibpy":
        return [sys.executable, str(HERE / "drive.py")]
    node = shutil.which("node")
    assert node is not None, "node is not installed"
    assert (ROSLIB / "node_modules").exists(), (
        f"there is no roslib in {ROSLIB}: 'make addons-test' installs it there, from npm"
    )
    return [node, shutil.copy(HERE / "drive.mjs", ROSLIB)]


@pytest.mark.parametrize("library", ["roslib", "roslibpy"])
def test_the_libraries_drive_the_robot(library: str, tmp_path: Path) -> None:
    """They list topics, get what was published before they came, drive, stop by the service and arm again."""
    words = program(library)

    async def scenario() -> None:
        async with system(tmp_path) as (port, url):
            process = await asyncio.create_subprocess_exec(*words, url, stdout=PIPE)
            try:
                output, _ = await asyncio.wait_for(process.communicate(), PATIENCE_S)
            finally:
                if process.returncode is None:
                    process.kill()
                    await process.wait()
            assert process.returncode == 0
            seen = json.loads(output)
            assert {"/odom", "/tf", "/cmd_vel", "/goal_pose", "/battery"} <= set(seen["topics"])
            assert seen["frame"] == "odom"
            assert seen["urdf"].startswith("<?xml")
            assert seen["stopped"] == seen["armed"] == {"success": True, "message": "done"}
            async with Client.connect(port=port) as robot:
                state = await robot.get_state()
            assert state.safety.mode == "armed"
            assert state.odometry.x_m == pytest.approx(seen["x_m"], abs=0.01)

    asyncio.run(scenario())


def test_each_client_has_its_own_lease_and_takes_its_velocity_along(tmp_path: Path) -> None:
    """Who took control is named to the others; when it leaves, the robot stands, and another may drive."""

    async def scenario() -> None:
        async with system(tmp_path) as (port, url), Client.connect(port=port) as robot, connect(url) as other:
            await robot.wait_until_armed()
            async with connect(url) as first:
                assert (await call(first, "/take_control"))["success"] is True
                async with repeating(first):
                    await until_moving(robot, moving=True)
                    await send(other, op="publish", topic="/cmd_vel", msg=AHEAD)
                    refused = await until(other, op="status", level="error")
                    assert "rosbridge 127.0.0.1" in refused["msg"]
            await until_moving(robot, moving=False)
            async with repeating(other):
                await until_moving(robot, moving=True)
            await send(other, op="unadvertise", topic="/cmd_vel")
            await until_moving(robot, moving=False)

    asyncio.run(scenario())


def test_a_clients_role_is_its_tokens(tmp_path: Path) -> None:
    """Without one it is sent away; a guest looks and is refused; a driver, by header or by URL, drives."""
    tokens = {"guest": "g" * 32, "agent": "a" * 32, "drive": "d" * 32}

    async def scenario() -> None:
        text = "".join(f"{role} {token}\n" for role, token in tokens.items())
        own = tmp_path / "own"
        own.write_text(f"agent {tokens['agent']}\n")
        async with system(tmp_path, text, "--token-file", str(own)) as (port, url):
            with pytest.raises(ConnectionClosed):
                async with connect(url) as nobody:
                    await asyncio.wait_for(nobody.recv(), PATIENCE_S)
            async with connect(f"{url}/?token={tokens['guest']}") as guest:
                await send(guest, op="subscribe", topic="/odom", type="nav_msgs/Odometry")
                odom = await until(guest, op="publish", topic="/odom")
                assert odom["msg"]["child_frame_id"] == "base_footprint"
                refusal = "came before anything was known"  # the bridge has a connection of its own, which may be slower
                while "came before anything was known" in refusal:
                    await send(guest, op="publish", topic="/cmd_vel", msg=AHEAD)
                    refusal = (await until(guest, op="status", level="error"))["msg"]
                assert "drive" in refusal
            bearer = {"Authorization": f"Bearer {tokens['drive']}"}
            async with (
                connect(url, additional_headers=bearer) as driver,
                Client.connect(port=port, token=tokens["agent"]) as robot,
            ):
                await robot.wait_until_armed()
                async with repeating(driver):
                    await until_moving(robot, moving=True)

    asyncio.run(scenario())


def test_pages_of_other_sites_are_refused(tmp_path: Path) -> None:
    """A browser tells whose page it is: only those that were allowed may connect."""

    async def scenario() -> None:
        async with system(tmp_path, "", "--origin", "http://robot.example") as (_, url):
            with pytest.raises(InvalidStatus) as refused:
                await connect(url, origin="http://elsewhere.example")
            assert refused.value.response.status_code == 403
            async with connect(url, origin="http://robot.example") as page:
                assert "/cmd_vel" in (await call(page, "/rosapi/topics"))["topics"]

    asyncio.run(scenario())
