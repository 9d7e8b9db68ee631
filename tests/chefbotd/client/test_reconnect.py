"""A connection that is lost and found again: what goes on, what is told, and what is never repeated."""

import asyncio
import gc
import math
from typing import Any

import pytest

from chefbotd.client import Client, ConnectionLost, ProtocolError, SubscriptionConflict
from chefbotd.client.caller import parse
from chefbotd.client.models import OdometryData
from chefbotd.clock import run_virtual
from chefbotd.core.events import LineSeen, TextReceived
from chefbotd.transport.ports import reserve_port
from tests.fakes.api import Served, serving
from tests.fakes.daemon import HELLO, Daemon, scripted


def test_subscriptions_go_on_after_a_restart_and_tell_the_gap() -> None:
    """The daemon is away for 3 s: calls made then fail and are not repeated, and the next event tells the gap."""

    async def main() -> None:
        port = reserve_port()
        async with serving(port=port) as first:
            client = Client.connect(port=port, reconnect=True)
            robot = await client.__aenter__()
            events = robot.subscribe("text")
            await events.__aenter__()
            first.bus.publish(TextReceived(1.0, "before"))
            assert (await anext(events)).gap is None
        await asyncio.sleep(0.1)
        with pytest.raises(ConnectionLost):
            await robot.drive(0.1, 0.0)
        await asyncio.sleep(3.0)
        async with serving(port=port) as second:
            await robot.wait_until_connected()
            second.bus.publish(TextReceived(2.0, "after"))
            event = await anext(events)
            assert event.data.text == "after"
            assert event.gap is not None
            assert 3.0 < event.gap.lasted_s < 6.0
            assert not event.gap.restarted  # both say session s1
            second.bus.publish(TextReceived(3.0, "on"))
            assert (await anext(events)).gap is None
            assert second.robot.calls == []
            await client.__aexit__(None, None, None)

    run_virtual(main())


def test_an_incompatible_daemon_is_not_gone_back_to() -> None:
    """When the daemon that comes back speaks another major version, subscriptions end and nothing is tried again."""
    met: list[int] = []

    async def script(daemon: Daemon) -> None:
        met.append(1)
        hello: dict[str, Any] = {**HELLO, "params": {**HELLO["params"], "protocol": f"{len(met)}.0"}}  # type: ignore[dict-item]
        daemon.say(hello)
        await daemon.answer(topics=["text"])

    async def main() -> None:
        async with (
            scripted(script) as (host, port),
            Client.connect(host, port, reconnect=True) as robot,
            robot.subscribe("text") as events,
        ):
            with pytest.raises(ProtocolError, match=r"2\.0"):
                await events.next(timeout_s=30.0)
            await asyncio.sleep(30.0)
            assert len(met) == 2

    run_virtual(main())


def with_robot(scenario: Any) -> None:
    """Run a scenario with the real server on a fake robot."""

    async def main() -> None:
        async with serving() as served, Client.connect(served.host, served.port) as robot:
            await scenario(served, robot)

    run_virtual(main())


def test_another_rate_for_the_same_topic_is_a_conflict() -> None:
    """The second subscription is told what the first one has; the first one goes on as it was."""

    async def scenario(served: Served, robot: Client) -> None:
        async with robot.subscribe("text", max_rate_hz=5) as first:
            with pytest.raises(SubscriptionConflict, match="at most 5 events/s and policy latest"):
                await anext(robot.subscribe(["link", "text"]))
            served.bus.publish(TextReceived(1.0, "on"))
            assert (await anext(first)).data.text == "on"
        async with robot.subscribe("text", policy="ordered"):
            pass  # the first one is over

    with_robot(scenario)


def test_a_loop_that_was_broken_out_of_is_over() -> None:
    """Nobody holds the subscription any more, so the daemon is told, and another rate is no conflict."""

    async def scenario(served: Served, robot: Client) -> None:
        served.bus.publish(TextReceived(1.0, "hi"))
        async for _ in robot.subscribe(["text", "raw"]):
            break
        gc.collect()
        await asyncio.sleep(0.1)
        assert not served.bus.has_listeners(LineSeen)
        async with robot.subscribe("text", max_rate_hz=3):
            pass

    with_robot(scenario)


def test_leaving_the_block_withdraws_what_was_driven() -> None:
    """The daemon takes the client's command back at once, and that of nobody else."""

    async def scenario(served: Served, robot: Client) -> None:
        async with Client.connect(served.host, served.port) as driver:
            await driver.drive(0.2, 0.0, "navigation")
        await asyncio.sleep(0.1)
        assert served.robot.calls[1:] == [("release", "navigation")]

    with_robot(scenario)


def test_a_cancelled_drive_brakes() -> None:
    """``drive_for`` ends with zero for its own source when it is cancelled after 0.3 s of 10 s."""

    async def scenario(served: Served, robot: Client) -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.3):
                await robot.drive_for(10.0, 0.2, -0.1, "navigation")
        twists = [twist for _, _, twist in served.robot.calls]
        assert 6 <= len(twists) <= 8  # every 0.05 s from the start, and the last
        assert {(t.linear_m_s, t.angular_rad_s) for t in twists[:-1]} == {(0.2, -0.1)}
        assert (twists[-1].linear_m_s, twists[-1].angular_rad_s) == (0.0, 0.0)

    with_robot(scenario)


def test_null_for_a_number_is_nan_and_anything_else_wrong_is_said() -> None:
    """What is not finite comes as null; what is missing is named."""
    told = {"x_m": None, "y_m": 2.0, "heading_rad": 0.3, "linear_m_s": 0.0, "angular_rad_s": 0.0}
    data = parse(OdometryData, {**told, "covariance": [0.0] * 8 + [None], "newer": 1})
    assert math.isnan(data.x_m)
    assert math.isnan(data.covariance[8])
    with pytest.raises(ProtocolError, match=r"OdometryData: .* missing required field `covariance`"):
        parse(OdometryData, told)
