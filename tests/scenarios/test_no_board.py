"""A daemon whose board is not there, as a new user meets it."""

import asyncio

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice


def test_without_a_board_the_robot_is_not_said_to_be_armed() -> None:
    """``no_board`` in ``get_state`` and on the topic, with device and reason; armed as soon as the board is there.

    ``drive`` and ``arm`` say the same, and an ``estop`` is told as what it is, board or not.
    """
    device = FakeSerialDevice(plugged=False)

    async def scenario() -> None:
        async with running_daemon(device) as client:
            await asyncio.sleep(5.0)
            state = await client.get_state()
            safety, link = state.safety, state.link
            assert (safety.mode, safety.armed) == ("no_board", False)
            assert safety.reason == "waiting for the board"
            assert (link.state, bool(link.reason)) == ("down", True)
            assert link.device == "/dev/ttyACM0"
            for method in ("drive", "arm"):
                with pytest.raises(CallError) as refused:
                    await (client.drive(0.1, 0.0) if method == "drive" else client.arm())
                assert refused.value.kind == "link_down"
            async with client.subscribe("safety") as changes:
                assert (await anext(aiter(changes))).data.mode == "no_board"
                device.plug()
                assert (await anext(aiter(changes))).data.mode == "armed"
            device.unplug()
            await asyncio.sleep(1.0)
            assert (await client.get_state()).safety.mode == "disarmed"
            await client.estop("smoke")
            assert (await client.get_state()).safety.mode == "estopped"

    run_virtual(scenario())
