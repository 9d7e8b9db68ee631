"""The process of a simulated depth camera, on the truth of a simulated robot."""

import asyncio
import json
from pathlib import Path

import numpy as np
import pytest

from chefbotd.clock import SystemClock
from chefbotd.components.depth_camera.link.process import SCAN, DepthMessage, MessageReader
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.components.depth_camera.simulated.spawn import spawn_with
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.settings import load, packaged
from tests.scenarios.test_depth_camera import EYE
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.realtime


@pytest.mark.slow
def test_it_draws_what_is_before_the_robot_and_the_things_that_are_put_there() -> None:
    """The dining table's edge 1.0 m ahead; then a chair before it, at 0.7 m. Stamps are of the daemon's clock."""
    sim = {"map_path": "flat", "start_x_m": 2.2, "start_y_m": 1.5, "start_heading_rad": 0.0}
    things = [{"x_m": 3.1, "y_m": 1.5, "radius_m": 0.2}]

    async def newest(things: list[dict[str, float]]) -> DepthMessage:
        settings = load(packaged("chefbot_lidar"), overrides={"sim.world": sim, "sim.things": things})
        with EmbeddedBoard(simulation_of(settings), SystemClock()) as board:
            child = await spawn_with(str(board.share_truth()), settings.sim)(
                DepthSourceParameters.model_validate_json(json.dumps(EYE))
            )
            running = asyncio.create_task(board.run(lambda _: None))
            reader, scans = MessageReader(), []  # type: ignore[var-annotated]
            try:
                async with asyncio.timeout(PATIENCE_S):
                    while len(scans) < 3:
                        scans += [each for each in reader.feed_bytes(await child.read()) if each.kind == SCAN]
            finally:
                await child.end()
                running.cancel()
            return scans[-1]

    table = asyncio.run(newest([]))
    chair = asyncio.run(newest(things))
    middle = slice(34, 46)
    assert np.median(table.values[middle]) == pytest.approx(1.0, abs=0.03)
    assert np.median(chair.values[middle]) == pytest.approx(3.1 - 0.2 - 2.3, abs=0.04)
    assert abs(chair.stamp_s - SystemClock().now_s()) < 10


def test_a_process_without_truth_ends_with_a_reason(tmp_path: Path) -> None:
    """No such file: told by its name."""

    async def scenario() -> str:
        camera = DepthSourceParameters.model_validate_json(json.dumps(EYE))
        child = await spawn_with(str(tmp_path / "nothing"), load().sim)(camera)
        assert await child.read() == b""
        return await child.end()

    assert "nothing" in asyncio.run(scenario())
