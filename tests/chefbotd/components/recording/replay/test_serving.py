"""A replay on the command socket: it may be looked at, at the recorded speed, and not be driven."""

import asyncio

import pytest

from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
from chefbotd.components.recording.replay.build import replayed_daemon
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.recorded import groups_of
from chefbotd.components.recording.replay.replay import Replay, ReplayPace
from chefbotd.components.recording.replay.run import Serving
from chefbotd.core.events.inputs import DaemonStarted
from chefbotd.settings import load
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.recording.replay.recordings import recorded, recorded_of
from tests.chefbotd.components.recording.replay.test_replay import drive


async def arc(robot: SimulatedRobot) -> None:
    """Four seconds."""
    await asyncio.sleep(1.0)
    await drive(robot, 0.2, 0.5, 2.0)
    await asyncio.sleep(1.0)


def test_a_client_sees_the_recorded_drive_and_cannot_change_it() -> None:
    """Odometry comes at the recorded speed; the description is there; neither drive nor estop nor gains are taken."""
    settings = load(overrides={"page.enabled": False})
    events = recorded(arc, settings)

    async def main() -> None:
        entries = ReplayEntries()
        started = next(each for each in events if isinstance(each, DaemonStarted))
        entries.set_time(started.stamp_s)
        daemon = replayed_daemon(settings, started, entries)
        replay = Replay(daemon, entries)
        loop = asyncio.get_running_loop()
        async with Serving(daemon):
            host, port = await daemon.server.address()
            async with Client.connect(host, port) as client, client.subscribe("odometry") as odometry:
                began_s = loop.time()
                running = asyncio.create_task(
                    replay.run(groups_of(recorded_of(events)), ReplayPace(1.0, loop.time))
                )
                seen = [(await anext(odometry)).data for _ in range(40)]
                for name, params in (
                    ("drive", {"linear_m_s": 0.1, "angular_rad_s": 0.0}),
                    ("estop", {}),
                    ("set_pid", {"wheel": "all", "kp_duty_per_m_s": 1.0}),
                ):
                    with pytest.raises(CallError, match=r"this is a replay|needs the role"):
                        await client.call(name, **params)
                assert "<robot" in (await client.call("get_description"))["urdf"]
                outcome = await running
                assert loop.time() - began_s == pytest.approx(outcome.seconds, abs=0.1)
        assert seen[-1].x_m > seen[0].x_m
        assert outcome.first is None, str(outcome.first)
        assert outcome.problems == []

    run_virtual(main())
