"""A changed configuration taken over by a daemon that runs, on the virtual clock, with the simulated robot behind it."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
import structlog

from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
from chefbotd.process import logs
from chefbotd.process.service import DaemonService
from chefbotd.settings import Settings, load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.missing import URDF_PARSER, hide
from tests.robot_files import full

OLD, NEW = "o" * 20, "n" * 20
SPEED_M_S = 0.3


class Robot:
    """A configuration in a file, the daemon that runs with it, and what its service tells systemd."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.write_text(full().read_text())
        self.told: list[str] = []

    async def _read(self) -> Settings:
        return load(self.path)

    def edit(self, old: str, new: str) -> None:
        """Change the file."""
        text = self.path.read_text()
        assert text.count(old) == 1, old
        self.path.write_text(text.replace(old, new))

    def run(
        self,
        scenario: Callable[[SimulatedRobot, DaemonService], Awaitable[None]],
        *,
        token: str | None = None,
    ) -> None:
        """Run the daemon with the file as it is now, and the scenario beside it."""

        async def running() -> None:
            settings = load(self.path)
            async with simulated_robot(settings, token=token) as robot:
                service = DaemonService(robot.daemon, settings, self._read, self.told.append)
                await asyncio.sleep(1.0)
                await scenario(robot, service)

        run_virtual(running())


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    """A robot with a file of its own."""
    return Robot(tmp_path / "chefbot.toml")


async def speed_after(client: Client, robot: SimulatedRobot, seconds: float) -> float:
    """How fast the robot truly is after so long of driving."""
    for _ in range(round(seconds / 0.1)):
        await client.drive(SPEED_M_S, 0.0)
        await asyncio.sleep(0.1)
    return robot.board.truth(0.0).twist.linear_m_s


def test_gains_change_while_the_robot_drives_and_those_that_were_tuned_stay(robot: Robot):
    """The file's kp becomes 150; the left wheel's ki, which set_pid made 90, is not the file's business."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        client = simulated.client
        await client.call("set_pid", wheel="left_wheel", ki=90.0)
        await client.drive(SPEED_M_S, 0.0)
        await asyncio.sleep(0.2)
        robot.edit("kp_duty_per_m_s = 200.0 ", "kp_duty_per_m_s = 150.0 ")
        await service.reload()
        gains = (await client.call("get_pid"))["wheels"]
        assert {name: each["ki"] for name, each in gains.items()} == {
            "left_wheel": 90.0,
            "right_wheel": 2000.0,
        }
        assert {name: each["kp"] for name, each in gains.items()} == {
            "left_wheel": 150.0,
            "right_wheel": 150.0,
        }
        assert (await client.call("get_state"))["safety"]["armed"]

    robot.run(scenario)
    assert "pid.kp_duty_per_m_s" in robot.told[-1]


def test_limits_change_when_the_robot_stands_and_not_before(robot: Robot):
    """0.34 m/s may become 0.11: asked for 0.3 it drives on as fast until it has stood, and 0.11 from then on.

    What the answer to a command says of the limit changes at the same time.
    """

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        client = simulated.client
        assert await speed_after(client, simulated, 3.0) == pytest.approx(0.3, abs=0.02)
        text = robot.path.read_text()
        head, _, rest = text.partition("[limits.linear]\n")
        lines = rest.splitlines(keepends=True)
        lines = ["max_forward_m_s = 0.11\n" if x.startswith("max_forward_m_s") else x for x in lines]
        robot.path.write_text(head + "[limits.linear]\n" + "".join(lines))
        await service.reload()
        assert "when the robot stands: limits.linear.max_forward_m_s" in robot.told[-1]
        assert await speed_after(client, simulated, 1.0) == pytest.approx(0.3, abs=0.02)
        await asyncio.sleep(3.0)
        assert await speed_after(client, simulated, 3.0) == pytest.approx(0.11, abs=0.01)
        allowed = await client.call("drive", linear_m_s=SPEED_M_S, angular_rad_s=0.0)
        assert allowed["limited_by"] == "limits.linear"

    robot.run(scenario)


def test_what_is_fixed_is_refused_by_its_key_and_the_rest_is_taken_over(robot: Robot):
    """The device and a wheel's radius cannot change; the gain beside them does, and each refusal says restart."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        robot.edit('device = "/dev/ttyACM0" ', 'device = "/dev/chefbot" ')
        text = robot.path.read_text()
        robot.path.write_text(text.replace("radius_m = 0.045\n", "radius_m = 0.05\n", 1))
        robot.edit("ks_duty = 21.2 ", "ks_duty = 25.5 ")
        with structlog.testing.capture_logs() as logged:
            await service.reload()
        (told,) = [entry for entry in logged if entry["event"] == "the configuration was reloaded"]
        assert [reason.partition(":")[0] for reason in told["refused"]] == [
            "link.device",
            "chassis.wheels.left_wheel.radius_m",
        ]
        assert all("sudo systemctl restart chefbotd" in reason for reason in told["refused"])
        assert told["changed"] == ("pid.ks_duty",)
        await service.reload()  # what was refused is still not in force, and is told again
        assert "link.device" in robot.told[-1]
        gains = (await simulated.client.call("get_pid"))["wheels"]
        assert {each["ks"] for each in gains.values()} == {25.5}

    robot.run(scenario)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("kp_duty_per_m_s = 200.0 ", "kp_duty_per_m_s = -3 ", "kp_duty_per_m_s"),
        ("[pid] ", "[pit] ", "pit"),
        ("[pid] ", "[pid ", "not valid TOML"),
    ],
)
def test_an_invalid_file_changes_nothing(robot: Robot, old: str, new: str, reason: str):
    """The gain that is right beside the mistake is not taken over either; the log names the mistake."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        before = await simulated.client.call("get_pid")
        robot.edit("ks_duty = 21.2 ", "ks_duty = 25.5 ")
        robot.edit(old, new)
        with structlog.testing.capture_logs() as logged:
            await service.reload()
        (told,) = [entry for entry in logged if entry["log_level"] == "error"]
        assert reason in told["error"]
        assert await simulated.client.call("get_pid") == before

    robot.run(scenario)
    assert "nothing has changed" in robot.told[-1]


def test_a_description_that_cannot_be_read_here_changes_nothing(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
):
    """Where the parser of URDF is not installed; the daemon goes on, and the log says what to install."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        before = await simulated.client.call("get_pid")
        robot.edit("ks_duty = 21.2 ", "ks_duty = 25.5 ")
        robot.edit('# description = "my.urdf" ', 'description = "my.urdf" ')
        hide(monkeypatch, *URDF_PARSER)
        with structlog.testing.capture_logs() as logged:
            await service.reload()
        (told,) = [entry for entry in logged if entry["log_level"] == "error"]
        assert "pip install 'chefbotd[urdf]'" in told["error"]
        assert await simulated.client.call("get_pid") == before

    robot.run(scenario)
    assert "nothing has changed" in robot.told[-1]


def test_a_file_that_the_reader_stumbles_over_does_not_end_the_daemon(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
):
    """Whatever the reader raises, and however: the robot drives on at its speed, and systemd is told."""

    def stumble(path: Path) -> Settings:
        raise RecursionError("too deep")

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        monkeypatch.setattr("tests.chefbotd.process.test_reload.load", stumble)
        await speed_after(simulated.client, simulated, 1.0)
        with structlog.testing.capture_logs() as logged:
            await service.reload()
        assert "too deep" in next(entry for entry in logged if entry["log_level"] == "error")["error"]
        assert await speed_after(simulated.client, simulated, 1.0) == pytest.approx(SPEED_M_S, rel=0.05)

    robot.run(scenario)
    assert "reload failed: see the log" in robot.told[-1]


def test_what_is_valid_with_a_restart_only_changes_nothing(robot: Robot):
    """A duty range of 1023 would allow an output of 900; without a restart the range is 255, and the gains stay."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        robot.edit("max_duty = 255 ", "max_duty = 1023 ")
        robot.edit("output_limit_duty = 255.0\n", "output_limit_duty = 900.0\n")
        before = await simulated.client.call("get_pid")
        with structlog.testing.capture_logs() as logged:
            await service.reload()
        (told,) = [entry for entry in logged if entry["log_level"] == "error"]
        assert "does not fit the settings that only a restart changes" in told["error"]
        assert await simulated.client.call("get_pid") == before

    robot.run(scenario)


def test_systemd_is_told_before_and_after(robot: Robot):
    """As sd_notify(3) asks of Type=notify-reload: RELOADING with the monotonic time in microseconds, then READY."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        service.report_ready("127.0.0.1:7333")
        await service.reload()

    robot.run(scenario)
    ready, reloading, again = robot.told
    assert ready.startswith("READY=1\nSTATUS=")
    assert "listening on 127.0.0.1:7333" in ready
    first, second = reloading.splitlines()
    assert first == "RELOADING=1"
    assert second.removeprefix("MONOTONIC_USEC=").isdigit()
    assert again.startswith("READY=1\nSTATUS=")
    assert "reloaded: nothing has changed" in again


def test_several_signals_while_one_is_served_are_one_reload(robot: Robot):
    """Three wishes at once read the file once."""

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        running = asyncio.create_task(service.loops[1]())
        for _ in range(3):
            service.want_reload()
        await asyncio.sleep(1.0)
        running.cancel()

    robot.run(scenario)
    assert len(robot.told) == 2


def test_the_tokens_are_read_again_and_who_came_with_an_old_one_has_to_go(robot: Robot):
    """The file's token is another now: it opens the socket, the old one does not, and its client is cut off."""
    tokens = robot.path.with_name("tokens")
    tokens.touch(mode=0o600)
    tokens.write_text(f"admin {OLD}\n")
    robot.edit("[api]\n", f'[api]\ntoken_file = "{tokens}"\n')

    async def scenario(simulated: SimulatedRobot, service: DaemonService) -> None:
        host, port = await simulated.daemon.server.address()
        tokens.write_text(f"drive {NEW}\n")
        await service.reload()
        async with Client.connect(host, port, token=NEW) as other:
            assert await other.call("ping")
        with pytest.raises(CallError) as refused:
            async with Client.connect(host, port, token=OLD):
                pass
        assert refused.value.kind == "wrong_token"
        tokens.write_text("nonsense\n")
        await service.reload()
        async with Client.connect(host, port, token=NEW) as other:
            assert await other.call("ping")

    robot.run(scenario, token=OLD)


def test_the_log_gets_another_level_also_through_loggers_that_were_used_before(
    capfd: pytest.CaptureFixture[str],
):
    """A logger that was used at 'info' says 'debug' after the change, and nothing below 'error' after another."""
    before = structlog.get_config()
    writer = logs.configure("info")
    try:
        log = structlog.get_logger(component="test")
        log.info("one")
        log.debug("two")
        logs.set_level("debug")
        log.debug("three")
        logs.set_level("error")
        log.warning("four")
    finally:
        writer.close()
        structlog.configure(**before)
        logging.basicConfig(force=True)
    said = capfd.readouterr().err
    assert ["one" in said, "two" in said, "three" in said, "four" in said] == [True, False, True, False]
