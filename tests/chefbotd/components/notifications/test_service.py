"""Messages wait in a bounded queue, are tried again, and no server holds up the loop."""

import asyncio
import json
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
import structlog
from click.testing import CliRunner
from pydantic import SecretStr

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, ManualClock, run_virtual
from chefbotd.components.notifications.cli import notify
from chefbotd.components.notifications.delivery import MessageServer, NotTaken, Post, Undeliverable, deliver
from chefbotd.components.notifications.episodes import Notice
from chefbotd.components.notifications.outbox import QUEUE_LENGTH, MessageQueue
from chefbotd.components.notifications.parameters import NoticeKind, NotificationsParameters
from chefbotd.components.notifications.service import NotificationService
from chefbotd.core.events import SafetyChanged
from chefbotd.core.record import replace
from chefbotd.process.build import build
from chefbotd.settings import load
from chefbotd.settings.errors import SettingsError
from chefbotd.settings.sections import secrets_of, switched_off
from tests.waiting import PATIENCE_S

SECRET = "3f9c-topic-secret"
TOKEN = "tk_AgQdq7mVBoFD37zQVN29RhuMzNIz2"
URL = f"https://ntfy.example/{SECRET}"
NTFY = MessageServer("ntfy", SecretStr(URL), SecretStr(TOKEN))


def notice(text: str = "It has reached its goal.", stamp_s: float = 0.0) -> Notice:
    """A message."""
    return Notice(NoticeKind.GOAL_DONE, "Goal reached", text, stamp_s)


class Server:
    """Answers with the errors that are left, then takes everything."""

    def __init__(self, *errors: Exception) -> None:
        self.errors, self.posts, self.times_s = list(errors), list[Post](), list[float]()

    async def send(self, post: Post) -> None:
        """Take one, or raise."""
        self.times_s.append(asyncio.get_running_loop().time())
        if self.errors:
            raise self.errors.pop(0)
        self.posts.append(post)


def run_outbox(server: Server, notices: list[Notice], seconds: float) -> tuple[MessageQueue, str]:
    """Send them on the virtual clock; the outbox, and all that was logged."""

    async def scenario() -> MessageQueue:
        outbox = MessageQueue(NTFY, "kitchen", LoopClock(), server.send)
        for each in notices:
            outbox.add_notice(replace(each, stamp_s=LoopClock().now_s()))
        running = asyncio.create_task(outbox.run())
        await asyncio.sleep(seconds)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return outbox

    with structlog.testing.capture_logs() as logged:
        outbox = run_virtual(scenario())
    return outbox, str(logged)


def test_a_message_is_tried_again_later_and_later_and_says_how_old_it_is():
    """Three times nobody answers: after 5, 10 and 20 s it is taken, 35 s old; the address is in no log."""
    server = Server(ConnectionRefusedError(f"{URL}"), NotTaken(503), TimeoutError())
    outbox, logged = run_outbox(server, [notice()], 60.0)
    waits_s = [later - earlier for earlier, later in zip(server.times_s, server.times_s[1:], strict=False)]
    assert waits_s == pytest.approx([5.0, 10.0, 20.0])
    assert server.posts[0].body == b"It has reached its goal. (This was 35 s ago.)"
    assert (outbox.sent, outbox.dropped) == (1, 0)
    assert SECRET not in logged
    assert TOKEN not in logged


def test_a_message_that_is_refused_for_good_is_not_tried_again():
    """The next one is sent."""
    server = Server(NotTaken(403))
    outbox, logged = run_outbox(server, [notice("first"), notice("second")], 10.0)
    assert [post.body for post in server.posts] == [b"second"]
    assert (outbox.sent, outbox.dropped) == (1, 1)
    assert "HTTP status 403" in logged


def test_a_message_is_given_up_after_six_hours():
    """A server that is never there gets no more than one attempt every five minutes."""
    server = Server(*[ConnectionRefusedError()] * 1000)
    outbox, _ = run_outbox(server, [notice()], 7 * 3600.0)
    assert outbox.dropped == 1
    assert len(server.times_s) < 6 * 12 + 10
    assert server.times_s[-1] - server.times_s[0] <= 6 * 3600.0


def test_in_a_full_queue_the_oldest_gives_way():
    """Of 40 messages the last 32 are sent."""
    server = Server()
    outbox, _ = run_outbox(server, [notice(str(number)) for number in range(40)], 1.0)
    assert [post.body for post in server.posts] == [str(n).encode() for n in range(40 - QUEUE_LENGTH, 40)]
    assert outbox.dropped == 40 - QUEUE_LENGTH


def test_a_message_tried_again_keeps_its_number():
    """So that a webhook can drop what it has had."""
    hook = MessageServer("webhook", SecretStr("https://hook.example/x"), None)
    body = json.loads(hook.make_post(notice(), "kitchen", 0.0, "17").body)
    assert body == {
        "id": "17",
        "robot": "kitchen",
        "kind": "goal_done",
        "title": "kitchen: Goal reached",
        "text": "It has reached its goal.",
        "age_s": 0.0,
    }


def test_a_robots_name_cannot_add_a_header():
    """What is not plain goes encoded."""
    title = NTFY.make_post(notice(), "Küche\r\nX-Evil: 1", 0.0, "17").headers["Title"]
    assert title.startswith("=?UTF-8?B?")
    assert title.isprintable()


def test_a_fault_on_the_bus_reaches_every_server_and_a_kind_that_is_left_out_none():
    """With the section's kinds; the loop is free meanwhile."""

    async def scenario(kinds: tuple[NoticeKind, ...]) -> list[Post]:
        bus, server = Bus(), Server()
        section = NotificationsParameters(
            enabled=True, ntfy_url=SecretStr(URL), webhook_url=SecretStr("http://hook/x"), kinds=kinds
        )
        service = NotificationService(bus, LoopClock(), section, "kitchen", server.send)
        running = asyncio.create_task(service.run())
        bus.publish(SafetyChanged(0.0, "armed", "", None))
        bus.publish(SafetyChanged(0.0, "estop", "the left wheel stands", None, "wheel_stalled", latch=1))
        await asyncio.sleep(5.0)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return server.posts

    assert len(run_virtual(scenario((NoticeKind.FAULT,)))) == 2
    assert run_virtual(scenario((NoticeKind.GOAL_DONE,))) == []


class Handler(BaseHTTPRequestHandler):
    """Remembers what it is sent."""

    got: list[tuple[str, dict[str, str], bytes]]

    def do_POST(self) -> None:
        """Take a message."""
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.got.append((self.path, dict(self.headers), body))
        self.send_response(200)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def loopback() -> Iterator[tuple[str, list[tuple[str, dict[str, str], bytes]]]]:
    """A web server on this computer: its address, and what it was sent."""
    got: list[tuple[str, dict[str, str], bytes]] = []
    server = HTTPServer(("127.0.0.1", 0), type("Kept", (Handler,), {"got": got}))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}", got
    server.shutdown()
    server.server_close()
    thread.join(PATIENCE_S)


def test_a_real_server_gets_the_title_the_priority_and_the_token(
    loopback: tuple[str, list[tuple[str, dict[str, str], bytes]]],
):
    """By the headers that ntfy documents."""
    url, got = loopback
    target = MessageServer("ntfy", SecretStr(f"{url}/topic?x=1"), SecretStr(TOKEN))
    asyncio.run(deliver(target.make_post(notice(), "kitchen", 0.0, "17")))
    ((path, headers, body),) = got
    assert (path, body) == ("/topic?x=1", b"It has reached its goal.")
    assert headers["Title"] == "kitchen: Goal reached"
    assert headers["Priority"] == "default"
    assert headers["Authorization"] == f"Bearer {TOKEN}"


def test_a_server_that_accepts_and_never_answers_does_not_hold_up_the_loop():
    """The loop turns 1,000 times while it is waited for; then the attempt ends, and its connection with it."""

    async def scenario(port: int, listener: socket.socket) -> bytes:
        attempt = asyncio.create_task(deliver(Post(f"http://127.0.0.1:{port}/x", {}, b"hello")))
        loop = asyncio.get_running_loop()
        peer, _ = await loop.sock_accept(listener)
        for _ in range(1000):
            await asyncio.sleep(0)
        assert not attempt.done()
        attempt.cancel()
        await asyncio.gather(attempt, return_exceptions=True)
        peer.setblocking(False)
        received = b""
        with peer:
            async with asyncio.timeout(PATIENCE_S):
                while data := await loop.sock_recv(peer, 4096):
                    received += data
        return received

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        received = asyncio.run(scenario(listener.getsockname()[1], listener))
    assert received.endswith(b"hello")


def test_an_attempt_ends_in_time_however_slowly_a_server_answers():
    """One that never ends its answer's head is an OSError, so that it is tried again."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/x"
        with pytest.raises(TimeoutError):
            asyncio.run(deliver(Post(url, {}, b""), within_s=0.05))


def test_an_address_that_cannot_be_is_no_failure_of_the_service():
    """A host's name with an empty part has no encoding; a failed service would stop the robot."""
    with pytest.raises(Undeliverable, match="Unicode"):
        asyncio.run(deliver(Post("http://a..b/x", {}, b"")))


def test_a_computer_without_room_for_a_thread_is_no_failure_of_the_service(monkeypatch: pytest.MonkeyPatch):
    """The message is tried again."""

    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    async def attempt() -> None:
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", refuse)
            await deliver(Post("http://127.0.0.1:1/x", {}, b""))

    with pytest.raises(Undeliverable):
        asyncio.run(attempt())


def test_text_that_has_no_encoding_is_sent_nevertheless():
    """A device's path may hold bytes that are no text."""
    post = NTFY.make_post(notice("/dev/\udcff is gone"), "k\udcff", 0.0, "17")
    assert post.body == b"/dev/? is gone"


def test_addresses_and_tokens_stand_in_no_settings_that_are_written_down_and_in_no_bundle():
    """A recording's settings have stars; the bundle knows what to take out; a replay tells nobody."""
    settings = load(
        overrides={
            "notifications.enabled": True,
            "notifications.ntfy_url": URL,
            "notifications.ntfy_token": TOKEN,
        }
    )
    assert SECRET not in settings.model_dump_json()
    assert TOKEN not in settings.model_dump_json()
    assert {URL, TOKEN} <= set(secrets_of(settings))
    assert not switched_off(settings)["notifications"].enabled
    daemon = build(settings, clock=ManualClock())
    assert "notifications" in [feature.name for feature in daemon.features]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("ntfy_url", f"ftp://host/{SECRET}"),
        ("ntfy_url", f"{SECRET}"),
        ("webhook_url", f"https://me:{SECRET}@host/"),
        ("webhook_token", f"{SECRET}\r\nX: 1"),
    ],
)
def test_a_bad_address_is_refused_by_its_key_and_not_repeated(key: str, value: str):
    """It may hold a secret."""
    with pytest.raises(SettingsError) as refused:
        load(overrides={"notifications.enabled": True, f"notifications.{key}": value})
    assert key in str(refused.value)
    assert SECRET not in str(refused.value)


def test_whoever_enables_it_names_a_server():
    """Or nobody would be told, unnoticed."""
    with pytest.raises(SettingsError, match="ntfy_url or webhook_url"):
        load(overrides={"notifications.enabled": True})


def configuration(folder: Path, url: str) -> str:
    """A robot's file that names a webhook."""
    path = folder / "robot.toml"
    path.write_text(
        f'extends = "chefbot"\n[notifications]\nenabled = true\nwebhook_url = "{url}/hook"\n',
        encoding="utf-8",
    )
    return str(path)


def test_the_end_of_the_daemon_is_told_once_an_hour_for_each_kind_of_end(
    tmp_path: Path, loopback: tuple[str, list[tuple[str, dict[str, str], bytes]]]
):
    """A crash and its repetitions are one message; an end that was asked for is another."""
    url, got = loopback
    arguments = ["--config", configuration(tmp_path, url), "--gone"]
    for result, status in (("signal", "SEGV"), ("signal", "SEGV"), ("success", "0"), ("success", "0")):
        env = {"SERVICE_RESULT": result, "EXIT_STATUS": status, "RUNTIME_DIRECTORY": str(tmp_path)}
        assert CliRunner().invoke(notify, arguments, env=env).exit_code == 0
    texts = [json.loads(body)["text"] for _, _, body in got]
    assert texts == [
        "chefbotd has ended unexpectedly (signal SEGV). It no longer watches the robot, which may still be moving.",
        "chefbotd has ended as it was asked to. The robot cannot be driven until it is started again.",
    ]


def test_a_test_message_names_the_server_that_did_not_take_it(tmp_path: Path):
    """Nothing listens there: the error names the webhook, and neither its address nor its secret."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    arguments = ["--config", configuration(tmp_path, f"http://127.0.0.1:{port}/{SECRET}")]
    result = CliRunner().invoke(notify, arguments)
    assert str(result.exception) == "not sent: webhook: ConnectionRefusedError"
