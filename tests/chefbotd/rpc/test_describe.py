"""The schemas of ``describe``: none is built by a server's construction, and none when somebody asks a running one."""

import asyncio
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
from pydantic import BaseModel

from chefbotd.clock import BEAT_S, run_virtual
from chefbotd.rpc import methods
from chefbotd.rpc.server import DESCRIBED_AFTER_S
from tests.fakes.api import line_client, new_server, serving
from tests.fakes.robot import topics_of


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[type[Any]]]:
    """Every model whose schema is built during the test, in a process that has built none before."""
    models: list[type[Any]] = []
    of_params, of_record = BaseModel.model_json_schema.__func__, methods.schema

    def count_params(model: type[BaseModel], **options: Any) -> dict[str, Any]:
        models.append(model)
        return of_params(model, **options)

    def count_record(model: type[Any]) -> dict[str, Any]:
        models.append(model)
        return of_record(model)

    monkeypatch.setattr(BaseModel, "model_json_schema", classmethod(count_params))
    monkeypatch.setattr(methods, "schema", count_record)
    methods._built_schema.cache_clear()
    yield models
    methods._built_schema.cache_clear()


def test_a_new_server_builds_no_schema(built: list[type[Any]]) -> None:
    """A start does not wait for what nobody has asked for yet."""
    new_server(simulated=True)
    assert built == []


def test_a_running_server_builds_one_schema_at_a_time(built: list[type[Any]]) -> None:
    """None holds up the loop for as long as all of them together; after that ``describe`` has none left to build."""

    async def scenario() -> None:
        async with serving(simulated=True) as served, line_client(served) as client:
            await asyncio.sleep(DESCRIBED_AFTER_S)
            at_once = [len(built)]
            parts = (
                2 * len(served.server.methods) + len(topics_of(simulated=True)) + len(methods.NOTIFICATIONS)
            )
            for _ in range(parts):
                await asyncio.sleep(BEAT_S)
                at_once.append(len(built))
            assert max(after - before for before, after in pairwise(at_once)) <= 2
            prepared = len(built)
            assert prepared > 30
            assert "drive" in (await client.ask("describe"))["result"]["methods"]
            assert len(built) == prepared

    run_virtual(scenario())


def test_describe_before_all_is_prepared_has_everything(built: list[type[Any]]) -> None:
    """Whoever asks at once gets what whoever asks later gets, and a second server builds nothing anew."""

    async def answer(wait_s: float) -> dict[str, Any]:
        async with serving(simulated=True) as served, line_client(served) as client:
            await asyncio.sleep(wait_s)
            return (await client.ask("describe"))["result"]

    answers: list[dict[str, Any]] = []

    async def scenario() -> None:
        answers.append(await answer(0.0))
        first = len(built)
        answers.append(await answer(5.0))
        assert len(built) == first

    run_virtual(scenario())
    assert answers[0] == answers[1]
