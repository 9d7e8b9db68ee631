"""docs/adding_a_feature.md shows a feature that works as it stands."""

import asyncio
import math
import re
from pathlib import Path
from typing import Any

import pytest

from chefbotd.clock import run_virtual
from chefbotd.features.feature import Feature, methods_and_topics
from chefbotd.rpc.method import method
from chefbotd.rpc.models import TopicData
from chefbotd.rpc.topics import Topic
from chefbotd.settings import load
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice

PAGE = Path(__file__).parents[3] / "docs" / "adding_a_feature.md"
pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not part of an installed package"
)


def test_the_worked_example_runs() -> None:
    """In a daemon on a scripted board: the method answers, the topic has data, the figure and the schemas are there."""
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    page: dict[str, Any] = {"__name__": "page"}
    exec(compile(code, str(PAGE), "exec"), page)
    device = FakeSerialDevice()
    board = ScriptedBoard(device)

    async def scenario() -> None:
        async with running_daemon(device, features=[page["trip"]]) as client:
            await asyncio.sleep(0.1)
            for counts in ((0, 0), (30, -20), (80, -50), (140, -90)):
                board.cycle(*counts)
                await asyncio.sleep(0.02)
            async with client.subscribe("trip") as trips:
                turned_rad = (await anext(aiter(trips))).data.turned_rad
            counts_per_turn = load().encoders.counts_per_turn
            assert turned_rad == pytest.approx((30 + 50 + 60) * math.tau / counts_per_turn)
            ended = await client.call("reset_trip", turned_rad=2.5)
            assert ended == {"turned_rad": pytest.approx(turned_rad)}
            assert (await client.call("reset_trip"))["turned_rad"] == 2.5
            assert (await client.call("get_stats"))["trip_resets"] == 2
            described = await client.call("describe")
            assert described["methods"]["reset_trip"]["summary"] == "End the trip, and begin another."
            assert described["methods"]["reset_trip"]["role"] == "drive"
            assert described["topics"]["stats"]["data"]["properties"]["trip_resets"]["type"] == "integer"

    run_virtual(scenario())


def test_two_features_with_one_topic_are_refused() -> None:
    """The error names the feature that came second, and what is taken."""
    topic = Topic("trip", (), TopicData, TopicData.of)
    features = [Feature("first", topics=(topic,)), Feature("second", topics=(topic,))]
    with pytest.raises(ValueError, match="second: topic trip already belongs to another feature"):
        methods_and_topics(features)


def test_a_method_without_a_model_of_its_parameters_is_refused() -> None:
    """It is the function that is named, when its class is made."""

    def fly(self: object, caller: object, params: int) -> TopicData:
        raise NotImplementedError

    with pytest.raises(TypeError, match="fly: params must be annotated with a Params, got <class 'int'>"):
        method(role=None)(fly)
