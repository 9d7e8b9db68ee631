"""Old intent moves nothing: what was sent before a stop, or waited too long, is not carried out and is told why."""

import asyncio
import fcntl
import json
import socket
import termios
import time
from array import array
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from contextlib import ExitStack
from functools import partial

import pytest
import uvloop
from structlog.testing import capture_logs

from chefbotd.rpc.models import MotionParams
from tests.budget import sample
from tests.chefbotd.rpc.test_guarded import TOKENS, tls_guard, trusting
from tests.fakes.api import Served, line_client, serving
from tests.fakes.robot import FakeRobot, methods_of_socket
from tests.waiting import PATIENCE_S, until

GET_STATE = b'{"jsonrpc":"2.0","id":1,"method":"get_state"}\n'
PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
READY = PING.replace(b'"id":1', b'"id":0')
ARM = b'{"jsonrpc":"2.0","id":9,"method":"arm"}\n'
DRIVE = b'{"jsonrpc":"2.0","id":9,"method":"drive","params":{"linear_m_s":0.17,"angular_rad_s":-0.3}}\n'
WHEELS = (
    b'{"jsonrpc":"2.0","id":9,"method":"set_wheel_velocities",'
    b'"params":{"name":["left"],"velocity_rad_s":[1.5]}}\n'
)
ESTOP = b'{"jsonrpc":"2.0","id":2,"method":"estop","params":{"reason":"smoke"}}\n'
STOP = b'{"jsonrpc":"2.0","id":2,"method":"stop"}\n'
MOVES = pytest.mark.parametrize("command", sample([DRIVE, ARM, WHEELS]))
Scenario = Callable[[Served], Awaitable[None]]
LOOPS = pytest.mark.parametrize("run", sample([uvloop.run, asyncio.run]))


def serve(run: Callable[..., None], scenario: Scenario, **limits: object) -> None:
    """Run a scenario with a served fake robot, in real time: kernels have no other."""

    async def main() -> None:
        async with serving(**limits) as served:
            await scenario(served)

    with capture_logs():
        run(main())


def connect(served: Served, stack: ExitStack) -> socket.socket:
    """A client that sends at once what it is given; the daemon has yet to let it in."""
    client = stack.enter_context(socket.create_connection((served.host, served.port)))
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return client


async def admitted(served: Served, stack: ExitStack) -> socket.socket:
    """A client that the daemon serves already."""
    client = connect(served, stack)
    client.sendall(READY)
    assert await answer(client, 0) == "ok"
    return client


def deliver(client: socket.socket, data: bytes) -> None:
    """Send it, and wait until the other end's kernel has acknowledged it: a busy one may be late, on loopback too."""
    client.sendall(data)
    waiting = array("i", [1])
    while waiting[0]:
        fcntl.ioctl(client, termios.TIOCOUTQ, waiting)


async def answer(client: socket.socket, request_id: int) -> str:
    """``ok``, or the kind of the error, of the answer to one request."""
    client.setblocking(False)
    seen = b""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            seen += await asyncio.get_running_loop().sock_recv(client, 1 << 20)
            for line in seen.split(b"\n")[:-1]:
                message = json.loads(line)
                if message.get("id") == request_id:
                    return str(message["error"]["data"]["kind"]) if "error" in message else "ok"


async def accepted(client: socket.socket, command: bytes) -> None:
    """Send it until it is carried out: on a busy computer it may be too old when it is read."""
    client.sendall(command)
    while (kind := await answer(client, 9)) != "ok":
        assert kind == "too_old"
        client.sendall(command)


async def authenticated(served: Served) -> asyncio.StreamWriter:
    """An admin's client through TLS, which the daemon serves already."""
    reader, writer = await asyncio.open_connection(served.host, served.port, ssl=trusting())
    token = TOKENS["admin"].encode()
    writer.write(b'{"jsonrpc":"2.0","id":1,"method":"authenticate","params":{"token":"%b"}}\n' % token)
    while json.loads(await reader.readline()).get("id") != 1:
        pass
    return writer


def judged(served: Served) -> int:
    """How many commands to arm or to drive were carried out, or were void."""
    calls = names(served)
    return calls.count("arm") + calls.count("drive") + served.void_commands.total()


def is_judged(served: Served, count: int) -> bool:
    """Whether more than so many were."""
    return judged(served) > count


def names(served: Served) -> list[object]:
    """What the robot was asked to do, by name."""
    return [name for name, *_ in served.robot.calls]


@LOOPS
def test_an_estop_voids_the_arm_that_others_sent_before_it(run: Callable[..., None]) -> None:
    """20 clients ask 50 times and arm, another one's e-stop overtakes them: none of the twenty arms follows it."""

    async def scenario(served: Served) -> None:
        with ExitStack() as stack:
            crowd = [await admitted(served, stack) for _ in range(20)]
            stopper = await admitted(served, stack)
            for client in crowd:
                client.sendall(GET_STATE * 50 + ARM)
            stopper.sendall(ESTOP)
            assert await answer(stopper, 2) == "ok"
            told = [await answer(client, 9) for client in crowd]
            calls = names(served)
            assert "arm" not in calls[calls.index("estop") :]
            void = Counter(told) - Counter(ok=told.count("ok"))  # a busy computer may find them too old first
            assert void.keys() <= {"overtaken", "too_old"}
            assert void.total() + calls.count("arm") == 20
            assert served.void_commands == void
            await accepted(stopper, ARM)

    serve(run, scenario)


@LOOPS
@MOVES
@pytest.mark.parametrize("stop", [ESTOP, STOP])
@pytest.mark.parametrize("mover_first", [True, False])
def test_what_waits_in_the_kernel_when_a_stop_is_carried_out_was_sent_before_it(
    run: Callable[..., None], command: bytes, stop: bytes, mover_first: bool
) -> None:
    """Both are there when the loop comes back from 0.1 s: whichever is read first, no motion follows the stop."""

    async def scenario(served: Served) -> None:
        with ExitStack() as stack:
            mover, stopper = await admitted(served, stack), await admitted(served, stack)
            pair: Sequence[tuple[socket.socket, bytes]] = [(mover, PING * 60 + command), (stopper, stop)]
            for client, said in pair if mover_first else pair[::-1]:
                deliver(client, said)
            time.sleep(0.1)  # noqa: ASYNC251 - the loop stands still
            assert await answer(stopper, 2) == "ok"
            assert await answer(mover, 9) in ("overtaken", "too_old")  # too old on a busy computer
            assert [name for name in names(served) if name != "release"] == [json.loads(stop)["method"]]
            await accepted(mover, command)

    serve(run, scenario)


@LOOPS
def test_who_waits_at_the_door_has_come_before_the_stop(
    monkeypatch: pytest.MonkeyPatch, run: Callable[..., None]
) -> None:
    """Five clients connect and arm while the loop stands still, and another one stops: none of them arms it again."""
    monkeypatch.setattr(FakeRobot, "command_timeout_s", PATIENCE_S)  # their order counts here, not their age

    async def scenario(served: Served) -> None:
        with ExitStack() as stack:
            stopper = await admitted(served, stack)
            newcomers = [connect(served, stack) for _ in range(5)]
            for client in newcomers:
                deliver(client, ARM)
            deliver(stopper, ESTOP)
            assert await answer(stopper, 2) == "ok"
            told = [await answer(client, 9) for client in newcomers]
            calls = names(served)
            assert "arm" not in calls[calls.index("estop") :]
            assert told.count("overtaken") >= 4  # one may have been let in before

    serve(run, scenario)


@LOOPS
@MOVES
def test_what_came_while_the_loop_stood_still_is_not_carried_out(
    run: Callable[..., None], command: bytes
) -> None:
    """Five of them behind a stand of 0.7 s are refused as too old; the same sent again is carried out."""

    async def scenario(served: Served) -> None:
        with ExitStack() as stack:
            client = await admitted(served, stack)
            for _ in range(5):
                client.sendall(command)
            time.sleep(0.7)  # noqa: ASYNC251 - the loop stands still
            assert await answer(client, 9) == "too_old"
            await until(lambda: served.void_commands == {"too_old": 5})
            assert served.robot.calls == []
            await accepted(client, command)
            assert len(served.robot.calls) == 1

    serve(run, scenario)


def test_and_so_through_tls() -> None:
    """Where what the kernel holds is encrypted."""

    async def scenario(served: Served) -> None:
        mover, stopper = await authenticated(served), await authenticated(served)
        mover.write(PING * 60 + ARM)
        stopper.write(ESTOP)
        time.sleep(0.1)  # noqa: ASYNC251 - the loop stands still
        await until(lambda: judged(served) == 1 and "estop" in names(served))
        calls = names(served)
        assert calls.count("arm") == len(calls[: calls.index("estop")])
        while names(served)[-1] != "arm":  # on a busy computer it may be too old when it is read
            mover.write(ARM)
            await until(partial(is_judged, served, judged(served)))
        calls, too_old = names(served), served.void_commands["too_old"]
        mover.write(ARM + DRIVE)
        time.sleep(0.8)  # noqa: ASYNC251 - the loop stands still
        await until(lambda: served.void_commands["too_old"] == too_old + 2)
        assert names(served) == calls
        for writer in (mover, stopper):
            writer.transport.abort()

    serve(uvloop.run, scenario, guard=tls_guard())


@pytest.mark.parametrize("run", [asyncio.run, uvloop.run])
def test_a_drive_behind_answers_that_nobody_reads_is_old_when_they_are_read(run: Callable[..., None]) -> None:
    """800 answers unread for 0.8 s, then read: the drive behind them moves nothing any more."""

    async def scenario(served: Served) -> None:
        async with line_client(served) as client:
            client.stop_reading()
            client.send_raw(GET_STATE * 800 + DRIVE)
            await asyncio.sleep(0.8)
            client.read_on()
            message = await client.read()
            while message["id"] != 9:
                message = await client.read()
            assert (message["error"]["data"]["kind"], served.robot.calls) == ("too_old", [])

    serve(run, scenario)


@pytest.mark.parametrize("behind", [b"", PING * 100, GET_STATE * 60])
def test_what_a_client_sends_behind_its_own_stop_is_carried_out(
    monkeypatch: pytest.MonkeyPatch, behind: bytes
) -> None:
    """E-stop, arm and drive in one piece, also behind more requests than a turn serves: in this order."""
    monkeypatch.setattr(FakeRobot, "command_timeout_s", 60.0)  # their order counts here, not their age

    async def scenario(served: Served) -> None:
        with ExitStack() as stack:
            client = connect(served, stack)
            first, last = (DRIVE.replace(b'"id":9', b'"id":%d' % number) for number in (8, 10))
            client.sendall(first + behind + ESTOP + ARM + last)
            assert await answer(client, 10) == "ok"
            calls = names(served)
            assert calls[calls.index("estop") :] == ["estop", "arm", "drive"]

    serve(uvloop.run, scenario)


def test_a_motion_that_was_decided_before_the_last_stop_is_refused() -> None:
    """With the number of the topic safety from before it, or of another run of the daemon; with today's it is done."""

    async def scenario(served: Served) -> None:
        served.robot.stop_number = 1048577
        with ExitStack() as stack:
            client = await admitted(served, stack)
            for number, expected in ((1048576, "stopped_since"), (7, "stopped_since"), (1048577, "ok")):
                asked = DRIVE.replace(b'"params":{', b'"params":{"if_stop_number":%d,' % number)
                if expected == "ok":
                    await accepted(client, asked)
                else:
                    client.sendall(asked)
                    assert await answer(client, 9) in (expected, "too_old")
        assert len([call for call in served.robot.calls if call[0] == "drive"]) == 1

    serve(asyncio.run, scenario)


def test_every_method_that_moves_the_robot_takes_the_number_of_the_last_stop() -> None:
    """But ``arm``, which takes the number of what it clears."""
    methods = methods_of_socket()
    moving = {name for name, method in methods.items() if method.moves}
    taking = {name for name, method in methods.items() if issubclass(method.params, MotionParams)}
    assert moving - taking == {"arm"}
    assert taking <= moving
