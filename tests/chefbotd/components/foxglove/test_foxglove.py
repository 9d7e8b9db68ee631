"""Live in Foxglove: a client of its protocol sees the channels of a recording, and their messages."""

import asyncio
import contextlib
import json
import struct
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from websockets.asyncio.client import ClientConnection, connect

from chefbotd.bus import Bus
from chefbotd.clock import SystemClock
from chefbotd.components.foxglove.parameters import FoxgloveParameters
from chefbotd.components.foxglove.server import FoxgloveServer
from chefbotd.components.foxglove.service import EXCLUDED, FoxgloveService
from chefbotd.core.events.robot import EventsDropped
from chefbotd.event_classes import class_of, event_names
from chefbotd.settings import SettingsError, load
from tests.chefbotd.components.recording.events import cycle, example, fault
from tests.robot_files import full
from tests.waiting import PATIENCE_S

LAYOUT = Path(__file__).parents[4] / "config" / "foxglove_layout.json"
SUBPROTOCOL = "foxglove.sdk.v1"
FREE = FoxgloveParameters(enabled=True, port=0)


async def channels_of(socket: ClientConnection, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """What is advertised, until all of these are."""
    found: dict[str, dict[str, Any]] = {}
    while not wanted <= found.keys():
        message = json.loads(await asyncio.wait_for(socket.recv(), PATIENCE_S))
        found |= {each["topic"]: each for each in message.get("channels", ())}
    return found


@pytest.mark.realtime
def test_a_client_sees_the_channels_and_what_happens() -> None:
    """Each channel is offered with its schema, and a message has the event, with the time since 1970."""

    async def main() -> None:
        bus, clock = Bus(), SystemClock()
        service = FoxgloveService(bus, clock, lambda: FoxgloveServer(FREE, "fox"), None, lambda _: None)
        serving = asyncio.create_task(service.run())
        try:
            await asyncio.sleep(0)  # it begins, and serves at once
            assert service.port is not None
            telling = asyncio.create_task(tell(bus, clock))
            async with connect(f"ws://127.0.0.1:{service.port}", subprotocols=[SUBPROTOCOL]) as socket:  # type: ignore[list-item]
                found = await channels_of(socket, {"/events/WheelsDriven", "/tf", "/pose"})
                assert found["/tf"]["schemaName"] == "foxglove.FrameTransforms"
                schema = json.loads(found["/events/WheelsDriven"]["schema"])
                assert "target_rad_s" in schema["properties"]
                number = found["/events/WheelsDriven"]["id"]
                await socket.send(
                    json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": number}]})
                )
                while not isinstance(data := await asyncio.wait_for(socket.recv(), PATIENCE_S), bytes):
                    pass
            kind, subscription, log_ns = struct.unpack_from("<BIQ", data)
            event = json.loads(data[13:])
            assert (kind, subscription) == (1, 7)
            assert event["duty"] == [101, -77]
            assert log_ns > 1_700_000_000 * 10**9
            telling.cancel()
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(main())


@pytest.mark.realtime
@pytest.mark.slow
def test_who_comes_late_is_told_what_still_holds() -> None:
    """An e-stop long before the viewer came is shown to it, and it is the last one."""

    async def main() -> dict[str, Any]:
        bus, clock = Bus(), SystemClock()
        service = FoxgloveService(bus, clock, lambda: FoxgloveServer(FREE, "fox"), None, lambda _: None)
        serving = asyncio.create_task(service.run())
        try:
            await asyncio.sleep(0)  # it begins, and serves at once
            for reason in ("stalled", "overspeed"):
                bus.publish(fault(clock.now_s(), reason))
            telling = asyncio.create_task(tell(bus, clock))
            async with connect(f"ws://127.0.0.1:{service.port}", subprotocols=[SUBPROTOCOL]) as socket:  # type: ignore[list-item]
                found = await channels_of(socket, {"/events/SafetyChanged"})
                number = found["/events/SafetyChanged"]["id"]
                await socket.send(
                    json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": number}]})
                )
                while not isinstance(data := await asyncio.wait_for(socket.recv(), PATIENCE_S), bytes):
                    pass
            telling.cancel()
            event: dict[str, Any] = json.loads(data[13:])
            return event
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    assert asyncio.run(main())["fault"] == "overspeed"


@pytest.mark.realtime
def test_every_channel_has_messages_that_hold_by_its_schema() -> None:
    """By the protocol's words: an event of each class, transforms, pose, scan, path and log come as offered."""

    async def main() -> None:
        bus, first = Bus(), example(class_of("ScanMeasured") or int).lidar
        service = FoxgloveService(
            bus, SystemClock(), lambda: FoxgloveServer(FREE, "fox"), first, lambda _: None
        )
        serving = asyncio.create_task(service.run())
        events = [example(class_of(name) or int) for name in sorted(event_names() - EXCLUDED)]
        offered, subscribed, held = dict[int, dict[str, Any]](), dict[int, int](), set[str]()
        wanted = {"/tf", "/pose", "/scan", "/path", "/log"}
        try:
            await asyncio.sleep(0)  # it begins, and serves at once
            async with (
                asyncio.timeout(PATIENCE_S),
                connect(f"ws://127.0.0.1:{service.port}", subprotocols=[SUBPROTOCOL]) as socket,  # type: ignore[list-item]
            ):
                while not wanted <= held or len(held) < len(events) or len(held) < len(offered):
                    for event in events:
                        bus.publish(event)
                    await asyncio.sleep(0.05)
                    for message in await heard(socket):
                        if isinstance(message, bytes):
                            channel = offered[subscribed[struct.unpack_from("<BIQ", message)[1]]]
                            jsonschema.validate(json.loads(message[13:]), json.loads(channel["schema"]))
                            held.add(channel["topic"])
                            continue
                        new = {each["id"]: each for each in json.loads(message).get("channels", ())}
                        offered |= new
                        asked = {len(subscribed) + index: number for index, number in enumerate(new)}
                        subscribed |= asked
                        wishes = [{"id": wish, "channelId": number} for wish, number in asked.items()]
                        await socket.send(json.dumps({"op": "subscribe", "subscriptions": wishes}))
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
        assert {each["encoding"] for each in offered.values()} == {"json"}

    asyncio.run(main())


async def heard(socket: ClientConnection) -> list[str | bytes]:
    """What has come by now."""
    messages: list[str | bytes] = []
    with contextlib.suppress(TimeoutError):
        while True:
            messages.append(await asyncio.wait_for(socket.recv(), 0.05))
    return messages


async def tell(bus: Bus, clock: SystemClock) -> None:
    """Cycles of a board."""
    while True:
        for event in cycle(clock.now_s()):
            bus.publish(event)
        await asyncio.sleep(0.02)


@pytest.mark.realtime
def test_a_port_that_is_taken_is_told_and_harms_nobody() -> None:
    """The service goes on, with nothing to serve: the robot is not stopped for it."""

    async def main() -> None:
        first = FoxgloveServer(FREE, "first")
        taken = FoxgloveParameters(enabled=True, port=first.port)
        bus = Bus()
        service = FoxgloveService(
            bus, SystemClock(), lambda: FoxgloveServer(taken, "second"), None, lambda _: None
        )
        serving = asyncio.create_task(service.run())
        await asyncio.sleep(0)  # it begins, and has tried at once
        assert not serving.done()
        assert service.port is None
        assert not bus.has_listeners(EventsDropped)
        serving.cancel()
        first.stop()

    asyncio.run(main())


def test_it_is_served_on_this_computer_only(tmp_path: Path) -> None:
    """Its protocol has no tokens, so another address is refused with what to do instead."""
    path = tmp_path / "robot.toml"
    path.write_text(full().read_text() + '\n[foxglove]\nenabled = true\nhost = "0.0.0.0"\n')
    with pytest.raises(SettingsError, match="ssh -L"):
        load(path)


@pytest.mark.skipif(not LAYOUT.exists(), reason="the layout is not part of an installed package")
def test_the_layout_shows_topics_that_there_are() -> None:
    """Every panel in the arrangement is described, and every path begins with a topic of a recording."""
    layout = json.loads(LAYOUT.read_text(encoding="utf-8"))

    def panels(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else [*panels(node["first"]), *panels(node["second"])]

    assert set(panels(layout["layout"])) == layout["configById"].keys()
    paths = [path["value"] for each in layout["configById"].values() for path in each.get("paths", ())]
    assert "/events/WheelsDriven.target_rad_s[0]" in paths
    drawn = layout["configById"]["3D!chefbot"]["topics"]
    assert set(drawn) == {"/scan", "/map", "/path", "/pose"}
