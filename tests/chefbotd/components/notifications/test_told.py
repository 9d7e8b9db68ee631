"""What is known of the messages: on the topic, and in the row of the status."""

import asyncio

from pydantic import SecretStr

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.notifications.delivery import NotTaken, Post
from chefbotd.components.notifications.events import NotificationsChanged
from chefbotd.components.notifications.parameters import NotificationsParameters
from chefbotd.components.notifications.service import NotificationService
from chefbotd.components.notifications.status_text import notifications
from chefbotd.rpc.method import methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role

SECRET = "3f9c-topic-secret"
SECTION = NotificationsParameters(
    enabled=True, ntfy_url=SecretStr(f"https://ntfy.example/{SECRET}"), kinds=("fault",)
)


def states_after(errors: list[Exception], seconds: float, *, tests: int = 1) -> list[NotificationsChanged]:
    """What the topic said while a message was sent to a server that fails with these first."""

    async def send(post: Post) -> None:
        await asyncio.sleep(0.5)
        if errors:
            raise errors.pop(0)

    async def main() -> list[NotificationsChanged]:
        bus, said = Bus(), list[NotificationsChanged]()
        bus.add_handler(said.append, NotificationsChanged)
        service = NotificationService(bus, LoopClock(), SECTION, "kitchen", send, lambda: 1_000_000.0)
        running = asyncio.create_task(service.run())
        await asyncio.sleep(0.1)
        (send_test,) = methods_of(service)
        assert send_test.role is Role.ADMIN
        for _ in range(tests):
            send_test.handle(None, NoParams())
        await asyncio.sleep(seconds)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return said

    return run_virtual(main())


def test_the_topic_says_that_a_message_waits_and_then_that_it_was_taken():
    """Nothing at first; after a refused connection it waits with the reason, and 5 s later it is taken."""
    said = states_after([ConnectionRefusedError(SECRET)], 10.0)
    assert [event.servers[0].state for event in (said[0], said[1], said[-1])] == ["silent", "waits", "taken"]
    assert any(event.servers[0].problem == "ConnectionRefusedError" for event in said)
    last = said[-1].servers[0]
    assert (last.host, last.at_s, last.waiting, last.sent, last.problem) == (
        "ntfy.example",
        1e6,
        0,
        1,
        "",
    )
    assert said[-1].kinds == ("fault",)
    assert SECRET not in str(said)


def test_a_message_that_is_refused_is_given_up_with_the_answer():
    """404 is no answer that passes."""
    last = states_after([NotTaken(404)], 10.0)[-1].servers[0]
    assert (last.state, last.problem, last.dropped) == ("given_up", "HTTP status 404", 1)


def test_a_button_that_is_pressed_again_and_again_sends_one_message():
    """While a test message waits, no other is made; the next one is, once it is taken."""
    assert states_after([], 10.0, tests=20)[-1].servers[0].sent == 1


def test_the_row_of_the_status_says_how_the_last_message_fared():
    """The server, its last message, and why it is not taken."""
    server = {
        "name": "ntfy",
        "host": "ntfy.example",
        "state": "silent",
        "title": "",
        "problem": "",
        "waiting": 0,
    }
    assert notifications({"servers": [server]}).text == "ntfy at ntfy.example: nothing sent yet"
    failed = server | {"state": "given_up", "title": "Goal reached", "problem": "HTTP status 404"}
    text = "ntfy at ntfy.example: 'Goal reached' given up (HTTP status 404)"
    assert notifications({"servers": [failed]}).text == text
