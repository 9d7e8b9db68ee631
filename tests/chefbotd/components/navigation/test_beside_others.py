"""What navigation tells localization."""

import asyncio
from typing import Any, cast

import pytest

from chefbotd.bus import Bus
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.navigation.beside_others import join_localization
from chefbotd.components.navigation.events import NavigationChanged
from chefbotd.components.navigation.skill_requests import SKILL, CheckMap, MapChecked
from chefbotd.components.worker.process import Worker


class FakeLocalization:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.goals: list[bool] = []
        self.check_map: Any = None

    def note_goal(self, *, has_goal: bool) -> None:
        self.goals.append(has_goal)


class FakeWorker:
    """Finds one thing wrong with every map."""

    async def request(self, skill: str, request: Any, answer: type[Any], *, deadline_s: float) -> Any:
        assert (skill, request, answer) == (SKILL, CheckMap(), MapChecked)
        return MapChecked("its zones cannot be read")


@pytest.fixture
def joined() -> tuple[Bus, FakeLocalization]:
    """A bus, and the localization that is joined by it."""
    bus, localization = Bus(), FakeLocalization()
    join_localization(bus, cast(Worker, FakeWorker()), cast(LocalizationService, localization))
    return bus, localization


@pytest.mark.parametrize(
    ("state", "has_goal"),
    [("planning", True), ("driving", True), ("recovering", True), ("paused", True), ("idle", False)],
)
def test_localization_knows_whether_there_is_a_goal(
    joined: tuple[Bus, FakeLocalization], state: str, has_goal: bool
) -> None:
    """In every state of navigation."""
    bus, localization = joined
    bus.publish(NavigationChanged(state, 1, "", stamp_s=1.0))
    assert localization.goals == [has_goal]


def test_localization_is_told_what_is_wrong_with_a_map(joined: tuple[Bus, FakeLocalization]) -> None:
    """By the words of the worker's own check."""
    assert asyncio.run(joined[1].check_map()) == "its zones cannot be read"
