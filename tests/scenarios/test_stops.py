"""The whole daemon, and several clients that drive, stop and arm in any order: whom a stop holds moves nothing."""

import asyncio
import json
import math
import random
from contextlib import AsyncExitStack

import pytest
from structlog.testing import capture_logs

from chefbotd.client import CallError, Client
from chefbotd.clock import VirtualLoop, run_virtual
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.chefbotd.driving.stop_rule import PAUSE_S, TAKING_PAUSE_S, Deed, is_held
from tests.scenarios.instruments import is_moving
from tests.scenarios.robots import OBEYED_S

TRIES = ("drive", "zero", "navigation")
ASKED = (*TRIES, "drive", "drive", "stop", "estop", "arm", "arm", "take", "release", "reconnect")
WAITS_S = {"wait a little": 0.4, "wait long": 1.1}


class Clients:
    """Clients by name, each on the newest of its connections, and what they have done so far."""

    def __init__(self, robot: SimulatedRobot, stack: AsyncExitStack) -> None:
        self._robot, self._stack = robot, stack
        self._clients: dict[str, tuple[int, Client, AsyncExitStack]] = {}
        self._connections = 0
        self._deeds: list[Deed] = []
        self._taken_s = -math.inf

    async def do(self, who: str, what: str) -> str:
        """One step; the kind of its error, or nothing. A drive is carried out just where the rule lets it."""
        await asyncio.sleep(WAITS_S.get(what, 0.1))
        if what in WAITS_S:
            return ""
        before = await self._robot.client.get_state()
        now_s, latched = asyncio.get_running_loop().time(), before.safety.mode != "armed"
        if what == "fault":
            self._robot.daemon.driving.fail(Fault(FaultKind.WHEEL_STALLED, "for a test"))
            if not latched:
                self._deeds.append(Deed(now_s, -1, "fault"))
            return ""
        number, client = await self._connected(who)
        kind, taken_from = "", None
        try:
            taken_from = await self._ask(client, who, what)
        except CallError as refusal:
            kind = str(refusal.kind)
        if what in TRIES:
            source = "navigation" if what == "navigation" else "teleop"
            held = latched or is_held(tuple(self._deeds), number, source, now_s)
            self._deeds.append(Deed(now_s, number, "try", source, latched))
            assert kind or not held, f"{who} moves the robot, though a stop holds it"
            assert held or kind != "stopped", f"{who} is held by nothing"
        elif what in ("stop", "estop"):
            self._deeds.append(Deed(now_s, number, what))
        elif what == "arm" and not kind:
            self._deeds.append(Deed(now_s, number, "ask"))
        elif what == "take" and not kind:
            self._note_taking(now_s, number, taken_from, latched=latched)
        return kind

    def _note_taking(self, now_s: float, number: int, taken_from: str | None, *, latched: bool) -> None:
        """It is a try, and asks to drive where it is no repetition, of this client or of another one."""
        tries = [deed for deed in self._deeds if (deed.what, deed.client) == ("try", number)]
        has_tried = any(deed.source == "teleop" and now_s - deed.at_s < PAUSE_S for deed in tries)
        is_anew = not has_tried and now_s - self._taken_s >= TAKING_PAUSE_S
        self._taken_s = now_s
        if taken_from is not None and is_anew and not latched:
            self._deeds.append(Deed(now_s, number, "ask", "teleop"))
        self._deeds.append(Deed(now_s, number, "try", "teleop", latched))

    async def _connected(self, who: str) -> tuple[int, Client]:
        if who not in self._clients:
            host, port = await self._robot.daemon.server.address()
            own = await self._stack.enter_async_context(AsyncExitStack())
            client = await own.enter_async_context(Client.connect(host, port, name=who))
            self._connections += 1
            self._clients[who] = self._connections, client, own
        number, client, _ = self._clients[who]
        return number, client

    async def _ask(self, client: Client, who: str, what: str) -> str | None:
        if what in TRIES:
            source = "navigation" if what == "navigation" else "teleop"
            await client.drive(0.0 if what == "zero" else 0.2, 0.0, source)
        elif what == "take":
            return await client.take_control()
        elif what == "release":
            await client.release_control()
        elif what == "reconnect":
            await self._clients.pop(who)[2].aclose()
        else:
            await {"stop": client.stop, "estop": client.estop, "arm": client.arm}[what]()
        return None


async def play(steps: list[tuple[str, str]]) -> tuple[list[str], float]:
    """Do all this on the simulated robot; the kinds of the errors, and the way that the robot went."""
    async with simulated_robot() as robot, AsyncExitStack() as stack:
        await asyncio.sleep(1.0)
        clients = Clients(robot, stack)
        kinds = [await clients.do(*step) for step in steps]
        return kinds, abs(robot.board.truth(0.0).world_from_base.x_m)


REPEATED = [("Ann", "drive")] * 20
RECONNECTED = [step for _ in range(10) for step in (("Ann", "drive"), ("Ann", "reconnect"))]


@pytest.mark.parametrize("latch", [("Bob", "estop"), ("robot", "fault")], ids=["estop", "fault"])
@pytest.mark.parametrize("repeated", [REPEATED, RECONNECTED], ids=["one connection", "a new one each"])
def test_an_estop_or_a_fault_and_another_clients_arm_let_nobody_drive_on(
    repeated: list[tuple[str, str]], latch: tuple[str, str]
) -> None:
    """Ann repeats through it and Bob's drive of zero and arm: she moves nothing until she has let go for a second."""
    bob = [latch, *repeated[:2], ("Bob", "zero"), ("Bob", "arm")]
    with capture_logs():
        kinds, went_m = run_virtual(play([*bob, *repeated]))
        assert went_m < 0.001
        assert [
            kind for kind, (_, what) in zip(kinds[len(bob) :], repeated, strict=True) if what == "drive"
        ] == ["stopped"] * sum(what == "drive" for _, what in repeated)
        kinds, went_m = run_virtual(play([*bob, *repeated, ("all", "wait long"), ("Ann", "drive")]))
        assert kinds[-1] == ""


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 40))])
def test_random_sequences_of_three_clients_keep_the_rule(seed: int) -> None:
    """A hundred steps: drives, stops, faults, arms, takeovers, reconnects and waits."""
    choose = random.Random(seed)
    steps = [(who, what) for who in ("Ann", "Bob", "Carl") for what in ASKED]
    steps += [("all", "wait a little")] * 3 + [("all", "wait long"), ("robot", "fault")]
    with capture_logs():
        run_virtual(play(choose.choices(steps, k=100)))


DRIVE = b'{"jsonrpc":"2.0","id":9,"method":"drive","params":{"linear_m_s":0.2,"angular_rad_s":0.0}}\n'


@pytest.mark.parametrize("paused_s", [0.26, 0.49])
def test_a_drive_that_waited_in_the_socket_through_a_pause_moves_nothing(paused_s: float) -> None:
    """Sent while a loop that drove stood still: refused, and no duty follows. Who repeats at 20 Hz drives on at once."""

    async def scenario() -> None:
        async with simulated_robot() as robot:
            loop = asyncio.get_running_loop()
            assert isinstance(loop, VirtualLoop)
            reader, writer = await asyncio.open_connection(*await robot.daemon.server.address())
            await reader.readline()
            await asyncio.sleep(1.0)

            async def drive(times: int) -> list[str]:
                kinds = []
                for _ in range(times):
                    writer.write(DRIVE)
                    answer = json.loads(await reader.readline())
                    kinds.append(answer["error"]["data"]["kind"] if "error" in answer else "ok")
                    await asyncio.sleep(0.05)
                return kinds

            assert set(await drive(20)) == {"ok"}
            assert all(robot.board.duty)
            writer.write(DRIVE)  # into the kernel, at once
            loop.stand_still(paused_s)
            assert json.loads(await reader.readline())["error"]["data"]["kind"] == "too_old"
            await asyncio.sleep(OBEYED_S)
            assert robot.board.duty == (0, 0)
            await asyncio.sleep(1.0)
            assert not is_moving(robot)
            assert set(await drive(20)) == {"ok"}
            loop.stand_still(paused_s)
            kinds = await drive(20)
            assert set(kinds[:4]) == {"too_old", "ok"}
            assert set(kinds[4:]) == {"ok"}
            assert all(robot.board.duty)
            writer.close()

    with capture_logs():
        run_virtual(scenario())
