"""A socket behind tokens and TLS: what opens it, who may do what, and what never leaves it."""

import asyncio
import contextlib
import json
import re
import socket
import ssl
from collections.abc import Callable, Mapping
from typing import Any

import pytest
import trustme
import uvloop
from msgspec.structs import replace
from structlog.testing import capture_logs

from chefbotd.client import CallError, CannotConnect, Client, ConnectionLost
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Twist2D
from chefbotd.rpc.access import Guard, Keyring
from chefbotd.rpc.method import Method
from chefbotd.rpc.parameters import Role
from tests.fakes.api import line_client, serving
from tests.fakes.example import example
from tests.fakes.robot import methods_of_socket

TOKENS = {str(role): f"{role}{role[0] * 32}"[:32] for role in Role}
KEYRING = Keyring.parse("\n".join(f"{role} {token}" for role, token in TOKENS.items()), "tokens")
GUARD = Guard(KEYRING)
AUTHORITY = trustme.CA()
BOTH_LOOPS = pytest.mark.parametrize("run", [run_virtual, uvloop.run])

Run = Callable[[Any], None]


def tls_guard() -> Guard:
    """Tokens, and a certificate for 127.0.0.1 from our authority."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    AUTHORITY.issue_cert("127.0.0.1").configure_cert(context)
    return Guard(KEYRING, context)


def trusting() -> ssl.SSLContext:
    """A client that trusts our authority."""
    context = ssl.create_default_context()
    AUTHORITY.configure_trust(context)
    return context


METHODS = {name: method for name, method in methods_of_socket().items() if method.role is not None}
CALLS = {
    name: example(method.params).model_dump(mode="json", exclude_unset=True)
    for name, method in METHODS.items()
}

# What keeps the robot safe, said again independently of the methods' own roles.
READS = re.compile(r"(get|list|plan)_\w+|describe|ping")
ENDS_MOTION = {"stop", "estop", "cancel_navigation", "pause_navigation"}
OF_THE_CLIENT_ITSELF = {"subscribe", "unsubscribe", "set_client_name", "cancel"}
TO_GOALS = {"navigate_to", "follow_waypoints", "go_home", "dock", "resume_navigation"}
"""What a program may ask for that does not drive by velocity: goals, on a map, with all guards."""

FOR_GUESTS = {"press_button", "answer_agent"}
"""What somebody may do who only orders: it tells an agent something, and moves and tunes nothing."""

HEARD_BY_GUESTS = {
    *("safety", "link", "firmware", "battery", "odometry", "ranges", "scan"),
    *("map", "map_pose", "mapping", "localization", "navigation", "path", "zones"),
    *("agents", "agent_events", "agent_data"),
}
"""Programs, the map with the robot on it, and whether it may move; not the log, the camera, or how it is made."""

MOVES = {
    *("drive", "set_wheel_velocities", "arm", "localize"),
    *TO_GOALS,
}
FOR_EVERYBODY = {"stop", "estop"}
"""Whoever may look may stop, also where there is no other room, and before all other requests."""
CHANGES_THE_ROBOT = {"set_pid", "undo_pid", "reset_board", "import_map", "rename_map", "delete_map"}


@pytest.mark.parametrize("role", Role)
def test_each_role_may_do_its_part(role: Role) -> None:
    """Every method with every role: it is carried out, or refused as forbidden and does nothing."""

    async def main() -> None:
        async with (
            serving(guard=GUARD) as served,
            Client.connect(served.host, served.port, token=TOKENS[role]) as robot,
        ):
            expected = {name for name, method in METHODS.items() if method.role and method.is_allowed(role)}
            assert {m for m in CALLS if await carried_out(robot, m)} == expected

    run_virtual(main())


def broken_rules(methods: Mapping[str, Method]) -> set[str]:
    """The methods that are open to a role which must not have them, and those that end motion and are not for all."""
    drivers = {name for name, method in methods.items() if method.moves or name in MOVES}
    return {
        name
        for name, method in methods.items()
        if (method.role is None and name not in ("authenticate", "redeem_invitation"))
        or (name in drivers and (method.role is Role.OBSERVE or not method.moves))
        or (name in drivers - TO_GOALS and method.role not in (Role.DRIVE, Role.ADMIN))
        or (method.role is Role.GUEST and name not in FOR_GUESTS)
        or (name in CHANGES_THE_ROBOT and method.role is not Role.ADMIN)
        or (name in ENDS_MOTION and (method.role is not Role.OBSERVE or method.moves))
        or (name in FOR_EVERYBODY and not (method.urgent and method.when_crowded))
        or (
            method.role is Role.OBSERVE
            and not READS.fullmatch(name)
            and name not in ENDS_MOTION | OF_THE_CLIENT_ITSELF
        )
    }


def test_a_guest_may_press_buttons_look_at_the_map_and_stop_the_robot_and_nothing_else() -> None:
    """Of the methods of every component, with maps and navigation: these. Whoever orders has no use for the rest."""
    every = methods_of_socket()
    may = {name for name, method in every.items() if method.is_allowed(Role.GUEST)}
    assert may == {
        *("authenticate", "redeem_invitation", "set_client_name", "ping", "describe", "get_description"),
        *("subscribe", "unsubscribe", "cancel", "get_map", "list_maps", "list_places", "list_zones"),
        *ENDS_MOTION,
        *FOR_GUESTS,
    }


def test_a_guest_hears_of_programs_the_map_and_whether_the_robot_may_move() -> None:
    """It is refused the log, the camera and all else, alone or among others, and its subscriptions stay as they are."""

    async def main() -> None:
        async with (
            serving(guard=GUARD) as served,
            Client.connect(served.host, served.port, token=TOKENS[Role.GUEST]) as guest,
            Client.connect(served.host, served.port, token=TOKENS[Role.OBSERVE]) as observer,
        ):
            topics = (await guest.describe()).topics
            heard = {name for name, topic in topics.items() if topic.for_guests}
            assert heard == HEARD_BY_GUESTS & topics.keys()
            assert {"safety", "link", "odometry", "battery"} <= heard < topics.keys()
            assert set((await guest.call("subscribe", topics=["safety"]))["topics"]) == {"safety"}
            for name in topics.keys() - heard:
                with pytest.raises(CallError, match="is not for guests") as refused:
                    await guest.call("subscribe", topics=["link", name])
                assert refused.value.kind == "forbidden"
            assert set((await guest.call("subscribe", topics=["battery"]))["topics"]) == {"safety", "battery"}
            await observer.call("subscribe", topics=sorted(topics))

    run_virtual(main())


def test_what_moves_the_robot_needs_a_driver_and_observers_only_read() -> None:
    """An observer asks (get_, list_, plan_), ends motion, or changes its own connection; what moves says so."""
    every = methods_of_socket()
    assert every.keys() >= MOVES | CHANGES_THE_ROBOT | ENDS_MOTION | FOR_GUESTS
    assert broken_rules(every) == set()


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("drive", {"role": Role.OBSERVE}),
        ("drive", {"moves": False}),
        ("ping", {"moves": True}),
        ("ping", {"role": None}),
        ("delete_map", {"role": Role.DRIVE}),
        ("stop", {"role": Role.DRIVE}),
        ("pause_navigation", {"role": Role.DRIVE}),
        ("stop", {"when_crowded": False}),
        ("estop", {"urgent": False}),
        ("reset_odometry", {"role": Role.OBSERVE}),
        ("drive", {"role": Role.AGENT}),
        ("arm", {"role": Role.AGENT}),
        ("localize", {"role": Role.AGENT}),
        ("navigate_to", {"role": Role.GUEST}),
        ("save_place", {"role": Role.GUEST}),
    ],
)
def test_a_method_that_breaks_the_rule_is_named(name: str, changes: dict[str, Any]) -> None:
    """Each way to open a method to somebody who must not have it, or to keep a stop from somebody."""
    every = methods_of_socket()
    assert broken_rules({**every, name: replace(every[name], **changes)}) == {name}


async def carried_out(robot: Client, method: str) -> bool:
    """Whether a method is carried out, or refused by itself and not for the role."""
    try:
        await robot.call(method, **CALLS[method])
    except CallError as error:
        if error.kind in ("invalid_params", "internal"):
            raise
        return error.kind != "forbidden"  # any other refusal is the method's own
    return True


def test_who_may_arm_is_configured() -> None:
    """With ``arm_role`` admin a driver may not; with observe anyone may."""

    async def may_arm(role: str, arm_role: str) -> bool:
        async with (
            serving(guard=GUARD, arm_role=arm_role) as served,
            Client.connect(served.host, served.port, token=TOKENS[role]) as robot,
        ):
            return await carried_out(robot, "arm")

    async def main() -> None:
        assert not await may_arm("drive", "admin")
        assert await may_arm("observe", "observe")

    run_virtual(main())


def test_without_tokens_everyone_has_the_default_role() -> None:
    """On loopback nobody is asked; ``default_role`` observe makes a socket to look at."""

    async def main() -> None:
        async with (
            serving(default_role="observe") as served,
            Client.connect(served.host, served.port, token="not asked for") as robot,
        ):
            assert robot.hello.auth == "none"
            assert (await robot.call("authenticate", token="x"))["role"] == "observe"
            assert {m for m in CALLS if await carried_out(robot, m)} == {
                name for name, method in METHODS.items() if method.role is Role.OBSERVE
            }

    run_virtual(main())


@pytest.mark.parametrize("method", [*CALLS, "fly"])
def test_nothing_is_carried_out_before_the_token(method: str) -> None:
    """Not even a stop, nor is it told whether a method exists."""

    async def main() -> None:
        async with serving(guard=GUARD) as served, line_client(served) as stranger:
            error = (await stranger.ask(method))["error"]
            assert error["data"]["kind"] == "unauthenticated"
            assert served.robot.calls == []
            assert "result" in await stranger.ask("authenticate", token=TOKENS["drive"])
            assert "result" in await stranger.ask("ping")

    run_virtual(main())


def test_the_greeting_says_that_a_token_is_wanted() -> None:
    """A client that has none is told on its first call what to do."""

    async def main() -> None:
        async with serving(guard=GUARD) as served, Client.connect(served.host, served.port) as robot:
            assert robot.hello.auth == "token"
            with pytest.raises(CallError, match="asks for a token") as caught:
                await robot.ping()
            assert caught.value.kind == "unauthenticated"

    run_virtual(main())


def test_a_wrong_token_ends_the_connection() -> None:
    """The error names no token, the refusal is counted, and the right token works on a new connection."""

    async def main() -> None:
        async with serving(guard=GUARD) as served:
            with pytest.raises(CallError) as caught:
                async with Client.connect(served.host, served.port, token="w" * 32):
                    pytest.fail("the wrong token opened the socket")
            assert caught.value.kind == "wrong_token"
            await asyncio.sleep(0.01)
            assert (served.clients, served.refused) == (0, {"wrong_token": 1})
            async with Client.connect(served.host, served.port, token=TOKENS["drive"]) as robot:
                await robot.ping()

    with capture_logs():
        run_virtual(main())


def test_who_does_not_authenticate_in_time_is_cut_off() -> None:
    """Five seconds; asking for something else meanwhile does not help."""

    async def main() -> None:
        async with serving(guard=GUARD) as served, line_client(served) as stranger:
            for _ in range(4):
                await asyncio.sleep(1.2)
                await stranger.ask("ping")
            assert served.clients == 1
            await asyncio.sleep(0.6)
            assert (await stranger.read())["error"]["data"]["kind"] == "timed_out"
            with pytest.raises(EOFError):
                await stranger.read()
            assert served.clients == 0

    with capture_logs():
        run_virtual(main())


@pytest.mark.parametrize(("host", "warned"), [("127.0.0.1", False), ("0.0.0.0", True)])
def test_tokens_that_can_be_overheard_are_warned_of(host: str, warned: bool) -> None:
    """Beyond loopback without TLS the log says so; it is allowed, for a network that is trusted."""

    async def main() -> None:
        async with (
            serving(guard=GUARD, host=host, token_file="tokens") as served,
            Client.connect("127.0.0.1", served.port, token=TOKENS["drive"]) as robot,
        ):
            await robot.ping()

    with capture_logs() as logs:
        run_virtual(main())
    assert ("api_not_encrypted" in [entry["event"] for entry in logs]) is warned


SECRET = "s3cret-s3cret-s3cret"


@pytest.mark.parametrize(
    "params",
    [
        {"token": SECRET},
        {"tokn": SECRET},
        {"token": [SECRET]},
        {"token": SECRET * 50},
        {"token": SECRET, "other": SECRET},
        {SECRET: 1},
    ],
)
def test_a_token_is_never_repeated(params: dict[str, Any]) -> None:
    """Wrong, misspelt, in a list or too long: neither the answer nor the log has it."""

    async def main() -> None:
        async with serving(guard=GUARD) as served, line_client(served) as client:
            answers.append(await client.ask("authenticate", **params))

    answers: list[dict[str, Any]] = []
    with capture_logs() as logs:
        run_virtual(main())
    assert "error" in answers[0]
    assert SECRET not in json.dumps(answers) + repr(logs)


@BOTH_LOOPS
def test_tls_from_end_to_end(run: Run) -> None:
    """A client that trusts the authority talks to the robot, on either loop."""

    async def main() -> None:
        async with serving(guard=tls_guard()) as served:
            async with Client.connect(
                served.host, served.port, token=TOKENS["drive"], tls=trusting(), name="Ann"
            ) as robot:
                await robot.drive(0.1, 0.0)
                assert served.robot.calls == [("drive", "teleop", Twist2D(0.1, 0.0))]
            await asyncio.sleep(0.05)
            assert (served.clients, served.robot.calls[-1]) == (0, ("release", "teleop"))

    run(main())


@BOTH_LOOPS
def test_an_untrusted_certificate_is_refused_by_the_client(run: Run) -> None:
    """Whoever does not know the authority does not send its token; the daemon serves on."""

    async def main() -> None:
        async with serving(guard=tls_guard()) as served:
            with pytest.raises(CannotConnect, match="certificate verify failed") as refused:
                async with Client.connect(
                    served.host, served.port, token=TOKENS["admin"], tls=ssl.create_default_context()
                ):
                    pytest.fail("trusted a stranger")
            assert isinstance(refused.value.__cause__, ssl.SSLCertVerificationError)
            await asyncio.sleep(0.05)
            assert served.clients == 0
            async with Client.connect(
                served.host, served.port, token=TOKENS["admin"], tls=trusting()
            ) as robot:
                await robot.ping()

    with capture_logs():
        run(main())


def test_plain_text_on_a_tls_port_gets_nothing() -> None:
    """No greeting, no answer, and the client is gone."""

    async def main() -> None:
        async with serving(guard=tls_guard()) as served:
            with pytest.raises(ConnectionLost):
                async with Client.connect(served.host, served.port, timeout_s=1.0) as robot:
                    await robot.ping()
            reader, writer = await asyncio.open_connection(served.host, served.port)
            writer.write(b'{"jsonrpc":"2.0","id":1,"method":"stop"}\n')
            assert b"jsonrpc" not in await reader.read()
            writer.close()
            await asyncio.sleep(0.05)
            assert (served.clients, served.robot.calls) == (0, [])

    with capture_logs():
        run_virtual(main())


def test_a_tls_handshake_that_never_comes_is_cut_off_and_counts_meanwhile() -> None:
    """A silent connection on a TLS port has five seconds, takes one slot, and then gives it back."""

    async def main() -> None:
        async with serving(guard=tls_guard(), max_new_connections=1) as served:
            with socket.create_connection((served.host, served.port)) as silent:
                await asyncio.sleep(0.1)
                assert served.clients == 1
                with socket.create_connection((served.host, served.port)) as second:
                    await asyncio.sleep(0.1)
                    assert silent.recv(100) == b""  # replaced, and not told so in plain text
                    await asyncio.sleep(5.0)
                    assert second.recv(100) == b""
            assert served.clients == 0

    with capture_logs():
        run_virtual(main())


@BOTH_LOOPS
def test_silent_tls_handshakes_keep_nobody_from_stopping(run: Run) -> None:
    """Connections that say nothing fill the slots: the oldest of an address give way to a newer one after a second."""

    async def main() -> None:
        async with serving(guard=tls_guard(), max_new_connections=5) as served:
            with contextlib.ExitStack() as stack:
                silent = [
                    stack.enter_context(socket.create_connection((served.host, served.port), timeout=1.0))
                    for _ in range(10)
                ]
                await asyncio.sleep(0.1)
                assert served.clients == 5
                assert [gone.recv(1) for gone in silent[4:9]] == [b""] * 5
                await asyncio.sleep(1.0)
                async with Client.connect(
                    served.host, served.port, token=TOKENS["observe"], tls=trusting()
                ) as robot:
                    await robot.estop("smoke")
                    assert served.robot.calls == [("estop", "smoke")]
                    assert served.clients == 5
                await asyncio.sleep(0.1)
                assert silent[0].recv(1) == b""
                assert (served.clients, served.refused) == (4, {"too_many_clients": 6})

    with capture_logs():
        run(main())
