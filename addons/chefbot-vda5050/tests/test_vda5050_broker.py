"""The robot on a real broker (mosquitto, on the loopback interface)."""

import asyncio
import random
import signal
import ssl
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
import trustme
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.messages import ConnectionState, encode
from chefbot_vda5050.topics import Kind
from vda5050_fakes import NAME, FakeRobot, is_idle
from vda5050_mosquitto import Mosquitto, mosquitto, program, relay
from vda5050_online import Master, master, robot_online
from vda5050_orders import HEADER, line

pytestmark = pytest.mark.usefixtures("version")
ONLINE, OFFLINE, BROKEN = ConnectionState.ONLINE, ConnectionState.OFFLINE, ConnectionState.BROKEN


def on_broker(folder: Path, scenario: Callable[[Master, Mosquitto], Awaitable[None]]) -> None:
    """Run a scenario with a master on a broker."""

    async def run() -> None:
        async with mosquitto(folder) as broker, master(broker.port) as now:
            await scenario(now, broker)

    asyncio.run(run())


def at(broker: Mosquitto) -> BrokerParameters:
    """How it is reached."""
    return BrokerParameters("127.0.0.1", broker.port)


def test_an_order_is_driven_over_the_broker(tmp_path: Path) -> None:
    """ONLINE and factsheet retained; states until the order is done; OFFLINE at the end."""

    async def scenario(now: Master, broker: Mosquitto) -> None:
        async with robot_online(at(broker), FakeRobot(20.0)):
            await now.until_state(lambda state: True)
            await now.order(line(0, 3))
            await now.until_state(lambda state: state.last_node_id == "n3" and is_idle(state))
            async with master(broker.port) as later:
                await later.until(
                    lambda: (
                        {kind for _, kind, _, kept in later.seen if kept}
                        == {
                            Kind.CONNECTION,
                            Kind.FACTSHEET,
                        }
                    )
                )
        await now.until(lambda: now.connections() == [ONLINE, OFFLINE])

    on_broker(tmp_path, scenario)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_program_leaves_the_fleet_when_it_is_told_to_end(number: signal.Signals, tmp_path: Path) -> None:
    """OFFLINE, and not CONNECTIONBROKEN: systemd ends it by SIGTERM. Killed, it is CONNECTIONBROKEN."""

    async def scenario(now: Master, broker: Mosquitto) -> None:
        where, version = f"127.0.0.1:{broker.port}", HEADER["version"]
        words = ("run", where, "r1", "--daemon", "127.0.0.1:1", "--version", version, "--interface", "uagv")
        for sent, last in ((number, OFFLINE), (signal.SIGKILL, BROKEN)):
            before = len(now.connections())
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "chefbot_vda5050.cli", *words, "--major", "v2"
            )
            await now.until(lambda before=before: now.connections()[before:] == [ONLINE])
            process.send_signal(sent)
            await now.until(lambda before=before, last=last: now.connections()[before:] == [ONLINE, last])
            assert await process.wait() == (0 if sent is number else -signal.SIGKILL)

    on_broker(tmp_path, scenario)


def test_a_robot_that_vanishes_is_reported_by_its_last_will(tmp_path: Path) -> None:
    """CONNECTIONBROKEN, retained: its socket is closed without a word."""

    async def scenario(now: Master, broker: Mosquitto) -> None:
        async with (
            relay(broker.port) as cable,
            robot_online(BrokerParameters("127.0.0.1", cable.port), FakeRobot()),
        ):
            await now.until_state(lambda state: True)
            cable.cut()
            await now.until(lambda: now.connections() == [ONLINE, BROKEN, ONLINE])

    on_broker(tmp_path, scenario)


def test_an_order_that_was_retained_is_not_driven(tmp_path: Path) -> None:
    """It lies on the broker when the robot comes."""

    async def scenario(now: Master, broker: Mosquitto) -> None:
        assert now.client is not None
        await now.client.publish(NAME.topic(Kind.ORDER), encode(line(0, 1)), retain=True)
        robot = FakeRobot(20.0)
        async with robot_online(at(broker), robot):
            state = await now.until_state(lambda state: state.errors)
            assert (state.order_id, robot.facts.x_m) == ("", 0.0)

    on_broker(tmp_path, scenario)


def test_a_broker_that_is_restarted_loses_no_order_and_the_robot_waits_at_its_base(tmp_path: Path) -> None:
    """Killed in mid drive: the robot comes to the end of its base, and drives on with the update after it."""

    async def scenario(now: Master, broker: Mosquitto) -> None:
        robot = FakeRobot(5.0)
        async with robot_online(at(broker), robot) as agent:
            await now.until_state(lambda state: True)
            await now.order(line(0, 4, base=2))
            await now.until_state(lambda state: state.last_node_id == "n0")
            await broker.kill()
            async with asyncio.timeout(100.0):
                while agent.vehicle.last_node_id != "n2" or len(robot.said) < 2:  # noqa: ASYNC110 - as it is seen
                    await asyncio.sleep(0.02)
            assert robot.facts.x_m == pytest.approx(2.0)
            assert "lost my fleet" in robot.said[0]
            await broker.start()
            await now.until_state(lambda state: state.last_node_id == "n2")
            await now.order(line(2, 4, update=1))
            await now.until_state(lambda state: state.last_node_id == "n4" and is_idle(state))
            assert now.connections()[-1] is ONLINE

    on_broker(tmp_path, scenario)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_an_update_that_a_broker_held_back_while_it_hung_is_not_driven(tmp_path: Path) -> None:
    """SIGSTOP for as long as the robot takes to notice (30 s): it waits at the end of its base, and says so.

    The update that was on its way meanwhile is late, and is not driven; the one after it is.
    """

    async def scenario(now: Master, broker: Mosquitto) -> None:
        robot = FakeRobot(1.0)
        async with robot_online(at(broker), robot) as agent:
            await now.until_state(lambda state: True)
            await now.order(line(0, 3, base=1))
            await now.until_state(lambda state: state.order_id == "o1")
            broker.send_signal(signal.SIGSTOP)
            await now.order(line(1, 3, update=1))
            async with asyncio.timeout(120.0):
                while not robot.said:  # noqa: ASYNC110 - as a person hears it
                    await asyncio.sleep(0.1)
            assert robot.said == ["I wait here until my fleet is back."]
            broker.send_signal(signal.SIGCONT)
            await now.until(lambda: now.connections()[-2:] == [BROKEN, ONLINE])
            await asyncio.sleep(2.0)
            assert (robot.facts.x_m, agent.vehicle.order_update_id) == (pytest.approx(1.0), 0)
            await now.order(line(1, 3, update=2))
            await now.until_state(lambda state: state.last_node_id == "n3" and is_idle(state))

    on_broker(tmp_path, scenario)


async def deliver(now: Master, robot: FakeRobot, orders: int) -> None:
    """Send orders one after the other as a master does: again and again until the state shows it."""
    for number in range(orders):
        first = round(robot.facts.x_m)
        order = line(first, first + 2, order_id=f"order {number}")

        def is_taken(wanted: str = order.order_id) -> bool:
            state = now.latest()
            return state is not None and state.order_id == wanted

        while not is_taken():
            await now.order(order)
            try:
                await now.until(is_taken, within_s=1.0)
            except TimeoutError:
                continue
        await now.until_state(
            lambda state, wanted=order.order_id: state.order_id == wanted and is_idle(state)
        )


def kills(folder: Path, count: int, seed: int) -> None:
    """A broker that is killed ``count`` times while orders are delivered and driven."""

    async def scenario(now: Master, broker: Mosquitto) -> None:
        chance, robot, orders = random.Random(seed), FakeRobot(20.0), 2 * count

        async def kill() -> None:
            for _ in range(count):
                await asyncio.sleep(chance.uniform(0.0, 0.6))
                await broker.kill()
                await asyncio.sleep(chance.uniform(0.0, 0.3))
                await broker.start()

        async with robot_online(at(broker), robot):
            killing = asyncio.create_task(kill())
            await deliver(now, robot, orders)
            await killing
            # each order has a node every metre: one that was lost, driven twice or driven late would leave another list
            assert robot.facts.x_m == pytest.approx(2.0 * orders)
            assert robot.driven == [(float(metre), 0.0) for metre in range(1, 2 * orders + 1)]

    on_broker(folder, scenario)


@pytest.mark.timeout(300)
def test_orders_survive_a_broker_that_is_killed_five_times(tmp_path: Path) -> None:
    """Ten orders of 2 m: each is driven once."""
    kills(tmp_path, 5, 1)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_orders_survive_a_broker_that_is_killed_fifty_times(tmp_path: Path) -> None:
    """A hundred orders of 2 m: each is driven once, in their sequence."""
    kills(tmp_path, 50, 2)


def test_user_password_and_encryption(tmp_path: Path) -> None:
    """With both the robot is there; a wrong password keeps it out, and it goes on trying."""
    authority = trustme.CA()
    authority.cert_pem.write_to_path(str(tmp_path / "ca.pem"))
    own = authority.issue_cert("127.0.0.1")
    own.private_key_pem.write_to_path(str(tmp_path / "key.pem"))
    own.cert_chain_pems[0].write_to_path(str(tmp_path / "cert.pem"))
    subprocess.run(
        [program("mosquitto_passwd"), "-b", "-c", str(tmp_path / "passwords"), "r1", "secret"], check=True
    )
    (tmp_path / "passwords").chmod(0o644)
    extra = f"""password_file {tmp_path}/passwords
cafile {tmp_path}/ca.pem
certfile {tmp_path}/cert.pem
keyfile {tmp_path}/key.pem
user {subprocess.run(["id", "-un"], check=True, capture_output=True, text=True).stdout.strip()}"""
    context = ssl.create_default_context(cafile=tmp_path / "ca.pem")

    async def run() -> None:
        async with mosquitto(tmp_path, extra) as broker:

            def parameters(password: str) -> Any:
                return BrokerParameters("127.0.0.1", broker.port, "r1", password, context)

            online = asyncio.Event()
            async with robot_online(parameters("wrong"), FakeRobot()) as agent:
                agent.set_online = lambda there: online.set()  # type: ignore[method-assign]
                with pytest.raises(TimeoutError):
                    await asyncio.wait_for(online.wait(), 1.0)
            async with robot_online(parameters("secret"), FakeRobot()) as agent:
                agent.set_online = lambda there: online.set()  # type: ignore[method-assign]
                await asyncio.wait_for(online.wait(), 100.0)

    asyncio.run(run())
