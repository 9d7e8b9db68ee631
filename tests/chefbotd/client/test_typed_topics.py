"""What type checkers infer for users of the clients. mypy tells of the second test: it does nothing when it runs."""

from typing import assert_type

from chefbotd.client import Client, SyncClient
from chefbotd.client.models import Driven, PathData
from chefbotd.client.subscription import Subscription
from chefbotd.client.sync_subscription import SyncSubscription
from tests.chefbotd.client.typed_topics import FILE, written


def test_the_typed_topics_are_those_of_the_models() -> None:
    """The overloads of ``subscribe`` are what ``make topics`` writes from the models' table."""
    assert FILE.read_text(encoding="utf-8") == written()


def test_both_clients_infer_the_same_types() -> None:
    """A literal topic gives its model; the plain client's methods return what the asyncio client's await."""

    async def with_asyncio(robot: Client) -> None:
        assert_type(robot.subscribe("path", max_rate_hz=2.0), Subscription[PathData])
        assert_type(await robot.drive(0.1, -0.2, source="joystick"), Driven)

    def without(robot: SyncClient) -> None:
        assert_type(robot.subscribe("path", max_rate_hz=2.0), SyncSubscription[PathData])
        assert_type(robot.drive(0.1, -0.2, source="joystick"), Driven)
        assert_type(robot.take_control(source="teleop"), str | None)
        robot.drive("fast", 0.0)  # type: ignore[arg-type]
        robot.navigate_to(plaice="kitchen")  # type: ignore[call-arg]

    assert callable(with_asyncio)
    assert callable(without)
