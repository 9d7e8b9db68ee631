"""The topics ``costmap`` and ``obstacles``: made only while somebody looks, and asked anew of a new worker."""

import asyncio
import zlib
from base64 import b64decode
from pathlib import Path

from chefbotd.clock import run_virtual
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.components.navigation.events import CostmapChanged, ObstaclesSeen
from chefbotd.components.navigation.skill_requests import REQUEST, SKILL, Show
from chefbotd.components.worker.messages import SkillEvent, SkillRequest, pack_body
from chefbotd.core.geometry import Pose2D
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import load
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.fakes.worker import FakeChild, Nursery, healthy

PART = CostmapChanged(
    stamp_s=1.5,
    map="flat",
    revision=3,
    resolution_m=0.05,
    map_from_grid=Pose2D(-1.0, 2.0, 0.25),
    columns=200,
    rows=90,
    column=80,
    row=40,
    part_columns=3,
    part_rows=2,
    cells=zlib.compress(bytes([0, 20, 100, 0, 99, 100])),
)


def asked_of(child: FakeChild) -> list[Show]:
    """What a worker was asked to show."""
    requests = [each for each in child.received_of(SkillRequest) if each.skill == SKILL]
    return [body for body in (REQUEST.decode(each.body) for each in requests) if isinstance(body, Show)]


def test_what_nobody_looks_at_is_not_made(tmp_path: Path) -> None:
    """The worker is asked with the first subscriber, no more after the last, and a new worker is asked again."""
    lidar = LidarParameters(name="top", model="ld19", device="/dev/absent")  # type: ignore[arg-type]
    settings = load().model_copy(update={"lidar": (lidar,), "maps": MapsParameters(folder=tmp_path)})
    nursery = Nursery(healthy)

    async def play() -> None:
        async with running_daemon(FakeSerialDevice(), settings, spawn_worker=nursery.spawn) as client:
            await asyncio.sleep(1.0)
            assert True not in {each.costmap or each.obstacles for each in asked_of(nursery.last)}
            async with client.subscribe("costmap") as costs:
                await asyncio.sleep(0.1)
                assert asked_of(nursery.last)[-1] == Show(costmap=True, obstacles=False)
                nursery.last.say(SkillEvent(SKILL, pack_body(PART), "CostmapChanged"))
                data = (await anext(aiter(costs))).data
                assert (data.map, data.revision, data.row, data.column) == ("flat", 3, 40, 80)
                assert Pose2D(data.x_m, data.y_m, data.heading_rad) == Pose2D(-1.0, 2.0, 0.25)
                assert zlib.decompress(b64decode(data.cells)) == bytes([0, 20, 100, 0, 99, 100])
                async with client.subscribe("obstacles") as obstacles:
                    await asyncio.sleep(0.1)
                    assert asked_of(nursery.last)[-1] == Show(costmap=True, obstacles=True)
                    seen = ObstaclesSeen(2.0, (1.25, 3.0), (-0.5, 0.75), 12, ((1.0, 2.0, 0.3, -0.1),))
                    nursery.last.say(SkillEvent(SKILL, pack_body(seen), "ObstaclesSeen"))
                    told = (await anext(aiter(obstacles))).data
                    assert (told.x_m, told.y_m, told.omitted) == ((1.25, 3.0), (-0.5, 0.75), 12)
                    assert (told.dynamic_obstacles[0].vx_m_s, told.dynamic_obstacles[0].vy_m_s) == (0.3, -0.1)
                await asyncio.sleep(0.1)
                nursery.last.die("it was killed by SIGKILL")
                await asyncio.sleep(2.0)
                assert len(nursery.children) == 2
                assert asked_of(nursery.last) == [Show(costmap=True, obstacles=False)]
            await asyncio.sleep(0.1)
            assert asked_of(nursery.last)[-1] == Show(costmap=False, obstacles=False)

    run_virtual(play())
