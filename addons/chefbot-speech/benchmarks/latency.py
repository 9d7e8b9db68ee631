"""How soon the robot brakes when talk is pressed, and the echo comes: ``python -m benchmarks.latency``.

On the real clock, before a simulated daemon: from the press on the page's WebSocket to the motors' commands on the
board's wire, as the topic ``raw`` tells them, which is later than they were written; and from the release to the echo,
for a release with the end of the last word, and for a later one, as recognition begins with the pause before it.
"""

import asyncio
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import median
from typing import Any, Final

import aiohttp
import numpy as np
from chefbot_speech.recognition import RATE_HZ
from chefbot_speech.sound import speech_end

from benchmarks.phrases import in_room, synthesized
from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client, ConnectionLost
from chefbotd.client.errors import CallError
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid

PORT: Final = 17_381
TIMES: Final = 10
SPEED_M_S: Final = 0.2
PIECE: Final = 2048
VOICE, TEXT = "flite:rms", "go to table three"
RELEASED_AFTER_S: Final = (0.0, 0.1, 0.25)


async def drive(robot: Client) -> None:
    """Drive until a stop."""
    try:
        while True:
            await robot.drive(SPEED_M_S, 0.0)
            await asyncio.sleep(0.05)
    except CallError:
        return


async def braking(robot: Client, page: aiohttp.ClientWebSocketResponse) -> tuple[float, float]:
    """Milliseconds from the press to the first slower command, and to zero."""
    await robot.arm()
    async with robot.subscribe("raw", policy="ordered") as lines:
        driving = asyncio.create_task(drive(robot))
        fastest, pressed_s, slower_ms = 0, 0.0, 0.0
        began_s = time.perf_counter()
        async for line in lines:
            now_s = time.perf_counter()
            if line.data.direction != "out" or not line.data.line.startswith("s"):
                continue
            duty = max(abs(int(float(word))) for word in line.data.line.split()[1:3])
            if not pressed_s and now_s - began_s > 1.5:
                fastest, pressed_s = duty, time.perf_counter()
                await page.send_json({"event": "press", "rate_hz": 16_000})
            elif pressed_s and duty < fastest and not slower_ms:
                slower_ms = 1000 * (now_s - pressed_s)
            if pressed_s and duty == 0:
                await page.send_json({"event": "release"})
                await driving
                return slower_ms, 1000 * (now_s - pressed_s)
    raise ConnectionLost("the daemon has ended")


async def echo(page: aiohttp.ClientWebSocketResponse, sound: bytes) -> float:
    """Milliseconds from the release to the proposal; each piece is sent when it has been said, as a page does it."""
    await page.send_json({"event": "press", "rate_hz": 16_000})
    for first in range(0, len(sound), 2 * PIECE):
        piece = sound[first : first + 2 * PIECE]
        await asyncio.sleep(len(piece) / 2 / RATE_HZ)
        await page.send_bytes(piece)
    released_s = time.perf_counter()
    await page.send_json({"event": "release"})
    while True:
        state: dict[str, Any] = await page.receive_json()
        if state["phase"] == "ready" and state["text"]:
            took_ms = 1000 * (time.perf_counter() - released_s)
            assert state["proposal"] == "table 3", state
            await page.send_json({"event": "answer", "choice": "no"})
            await page.receive_json()
            return took_ms


@asynccontextmanager
async def speech(port: int) -> AsyncIterator[aiohttp.ClientWebSocketResponse]:
    """The program, and a page's WebSocket to it."""
    words = (
        sys.executable,
        "-m",
        "chefbot_speech.main",
        "--connect",
        f"127.0.0.1:{port}",
        "--port",
        str(PORT),
    )
    program = await asyncio.create_subprocess_exec(*words, stdout=asyncio.subprocess.DEVNULL)
    try:
        async with aiohttp.ClientSession() as session:
            while True:
                try:
                    page = await session.ws_connect(f"http://127.0.0.1:{PORT}/socket")
                    break
                except aiohttp.ClientError:
                    await asyncio.sleep(0.1)
            await page.send_json({"token": None})
            await page.receive_json()
            yield page
    finally:
        program.terminate()
        await program.wait()


async def measure(folder: Path) -> None:
    """Print the figures."""
    cells = np.zeros((200, 200), np.int8)
    save(MapStore(folder / "maps"), "flat", OccupancyGrid(0.05, Pose2D(-5.0, -5.0, 0.0), cells))
    sound = in_room(synthesized(VOICE, TEXT, folder), None, 1)
    end = speech_end(sound, RATE_HZ)
    environment = {"CHEFBOTD_MAPS__FOLDER": str(folder / "maps")}
    async with (
        simulated_daemon("chefbot_lidar", environment) as (where, _),
        Client.connect(where.host, where.port, name="a joystick") as robot,
    ):
        await robot.wait_until_armed(30.0)
        await robot.load_map("flat")
        for number in range(1, 6):
            await robot.save_place(f"table {number}", float(number) - 3.0, 1.0, 0.0, kind="table")
        async with speech(where.port) as page:
            await asyncio.sleep(2.0)
            echoes_ms = {
                after_s: [
                    await echo(page, sound[: end + int(after_s * RATE_HZ)].tobytes()) for _ in range(TIMES)
                ]
                for after_s in RELEASED_AFTER_S
            }
            stops = [await braking(robot, page) for _ in range(TIMES)]
    for name, values in (
        ("press to the first slower command", [slower for slower, _ in stops]),
        ("press to zero (at the limit of deceleration)", [zero for _, zero in stops]),
        *(
            (f"release {after_s:g} s after the last word to the echo", took)
            for after_s, took in echoes_ms.items()
        ),
    ):
        print(f"{name}: median {median(values):.0f} ms, longest {max(values):.0f} ms of {len(values)}")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        asyncio.run(measure(Path(scratch)))
