"""Who is served, and who may talk."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import aiohttp
import pytest
from chefbot_speech.main import admit
from chefbot_speech.server import GREETING_S, MOST_TALKERS, PageServer, Send, Talker

from chefbotd.client import CallError
from chefbotd.clock import run_virtual


class FakeTalker:
    """Remembers what it was told."""

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.left = asyncio.Event()

    async def begin(self) -> None:
        """Nothing is shown."""

    async def take(self, message: dict[str, Any]) -> None:
        """Remember it."""
        self.told.append(message)

    def add_sound(self, data: bytes) -> None:
        """Remember it."""
        self.told.append(data)

    async def leave(self) -> None:
        """Remember it."""
        self.left.set()


class FakeDaemon:
    """Knows two tokens and their roles. Its greeting says whether it asks for one (``auth``: ``token`` or ``none``)."""

    def __init__(self, auth: str = "token") -> None:
        self.hello = SimpleNamespace(auth=auth)

    ROLES = {"orders": "guest", "waits": "agent"}

    @asynccontextmanager
    async def connect(self, token: str | None) -> AsyncIterator["FakeDaemon"]:
        """A wrong token is refused here, as the client does it."""
        if token is not None and token not in self.ROLES:
            raise CallError(-32021, "wrong_token", "this token opens nothing")
        yield self

    async def call(self, method: str, token: str) -> dict[str, str]:
        """``authenticate``."""
        if token not in self.ROLES:
            raise CallError(-32020, "unauthenticated", "this daemon requires a token")
        return {"role": self.ROLES[token]}


Scenario = Callable[[aiohttp.ClientSession, str, FakeTalker], Awaitable[None]]


CLOSED = {aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.ERROR}


def served(
    scenario: Scenario,
    auth: str = "token",
    *,
    needs_tokens: bool = False,
    run: Callable[[Coroutine[Any, Any, None]], None] = asyncio.run,
) -> None:
    """Run a scenario before the server."""

    async def serve() -> None:
        talker = FakeTalker()

        def make(send: Send) -> Talker:
            return talker

        listening: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        server = PageServer(admit(FakeDaemon(auth).connect, make, needs_tokens=needs_tokens))
        task = asyncio.create_task(server.run("127.0.0.1", 0, listening.set_result))
        async with aiohttp.ClientSession() as session, asyncio.timeout(100.0):
            await scenario(session, await listening, talker)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(serve())


def test_the_page_allows_its_own_files_alone() -> None:
    """By the headers of the daemon's page; nothing else is there."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        for path in ("", "talk.js", "stops.js", "microphone.js", "style.css"):
            async with session.get(url + path) as answer:
                assert answer.status == 200
                assert "default-src 'none'; script-src 'self'" in answer.headers["Content-Security-Policy"]
        async with session.get(f"{url}../main.py") as answer:
            assert answer.status == 404

    served(scenario)


@pytest.mark.parametrize(
    ("headers", "status"), [({"Host": "evil.example"}, 421), ({"Origin": "http://evil.example"}, 403)]
)
def test_another_site_may_not_talk(headers: dict[str, str], status: int) -> None:
    """Neither under a name of its own, nor from a page of its own."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await session.ws_connect(f"{url}socket", headers=headers)
        assert refused.value.status == status

    served(scenario)


def test_nobody_from_elsewhere_may_talk_to_a_daemon_that_asks_for_no_token() -> None:
    """It would take any word for one: the page's own computer is all that it knows."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        async with session.ws_connect(f"{url}socket") as socket:
            await socket.send_json({"token": "waits"})
            answer = await socket.receive_json()
        assert "asks for no tokens" in answer["refused"]
        assert talker.told == []

    served(scenario, auth="none", needs_tokens=True)


@pytest.mark.parametrize(
    ("token", "why"),
    [
        (None, "show a token"),
        ("wrong", "this token opens nothing"),
        ("orders", "the role guest may not send the robot anywhere"),
    ],
)
def test_who_may_not_send_the_robot_anywhere_may_not_talk(token: str | None, why: str) -> None:
    """With the reason; nothing that follows is listened to."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        async with session.ws_connect(f"{url}socket") as page:
            await page.send_json({"token": token})
            await page.send_json({"event": "press"})
            assert await page.receive_json() == {"refused": why}
            assert (await page.receive()).type is aiohttp.WSMsgType.CLOSE
        assert talker.told == []

    served(scenario)


def test_a_token_of_an_agent_opens_the_page() -> None:
    """What is pressed and said arrives in order; a closed page leaves."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        async with session.ws_connect(f"{url}socket") as page:
            await page.send_json({"token": "waits"})
            await page.send_json({"event": "press"})
            await page.send_bytes(b"sound")
        await talker.left.wait()
        assert talker.told == [{"event": "press"}, b"sound"]

    served(scenario)


def test_pages_that_show_no_token_keep_nobody_from_talking() -> None:
    """Ten sockets that are open and silent take no place of those who talk, and are closed after a while."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        silent = [await session.ws_connect(f"{url}socket") for _ in range(MOST_TALKERS + 2)]
        async with session.ws_connect(f"{url}socket") as page:
            await page.send_json({"token": "waits"})
            await page.send_json({"event": "press"})
        await talker.left.wait()
        assert talker.told == [{"event": "press"}]
        await asyncio.sleep(GREETING_S)
        assert {(await page.receive()).type for page in silent} <= CLOSED

    served(scenario, run=run_virtual)


def test_a_ninth_who_talks_is_told_that_it_is_too_many() -> None:
    """Eight have shown a token and stay."""

    async def scenario(session: aiohttp.ClientSession, url: str, talker: FakeTalker) -> None:
        pages = [await session.ws_connect(f"{url}socket") for _ in range(MOST_TALKERS)]
        for page in pages:
            await page.send_json({"token": "waits"})
            await page.send_json({"event": "press"})
        await asyncio.sleep(1.0)
        assert len(talker.told) == MOST_TALKERS
        async with session.ws_connect(f"{url}socket") as ninth:
            await ninth.send_json({"token": "waits"})
            assert await ninth.receive_json() == {"refused": "too many people talk to this robot"}
        assert not any(page.closed for page in pages)

    served(scenario, run=run_virtual)


class Leaving:
    """What a server needs of a WebSocket whose page greets, and is gone before anything is sent to it."""

    closed = False

    async def receive_json(self, **options: float) -> dict[str, str]:
        """The greeting."""
        return {"token": "waits"}

    async def send_str(self, text: str) -> None:
        """As aiohttp does it."""
        raise aiohttp.ClientConnectionResetError("Cannot write to closing transport")

    def __aiter__(self) -> "Leaving":
        return self

    async def __anext__(self) -> aiohttp.WSMessage:
        raise StopAsyncIteration


def test_a_page_that_goes_while_it_is_admitted_has_left() -> None:
    """What is shown to it is lost, and nothing else happens."""
    talker = FakeTalker()

    async def admitted(token: str | None, send: Send) -> Talker:
        await send({"phase": "ready"})
        return talker

    asyncio.run(PageServer(admitted)._talk(Leaving()))  # type: ignore[arg-type]
    assert talker.left.is_set()
