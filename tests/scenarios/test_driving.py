"""The whole daemon drives each simulated robot, on a virtual clock."""

import asyncio
import hashlib
import math
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
from chefbotd.core.events import TruthSimulated
from chefbotd.core.geometry import Twist2D
from chefbotd.motion.kinematics import Kinematics
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.fakes.wheels import wheel_speeds_rad_s
from tests.scenarios.robots import OBEYED_S, knowing_its_size

Scenario = Callable[[SimulatedRobot], Awaitable[None]]


@pytest.fixture(params=["chefbot", "khan"])
def settings(request: pytest.FixtureRequest) -> Settings:
    """Each packaged robot in turn."""
    return load(packaged(request.param))


def strongest(settings: Settings) -> str:
    """The source whose command beats all others."""
    sources = settings.safety.sources
    return max(sources, key=lambda name: sources[name].priority)


def weakest(settings: Settings) -> str:
    """The source whose command all others beat."""
    sources = settings.safety.sources
    return min(sources, key=lambda name: sources[name].priority)


def still(settings: Settings) -> tuple[int, ...]:
    """The duty of a robot that brakes."""
    return (0,) * len(settings.chassis.wheels)


def stop_line(settings: Settings) -> bytes:
    """The stop as it stands on the wire."""
    return b"s" + b" 0" * len(settings.chassis.wheels) + b"\r"


def unguarded(settings: Settings) -> Settings:
    """The same robot, that runs into what it sees."""
    guard = settings.safety.guard.model_copy(update={"enabled": False})
    return settings.model_copy(update={"safety": settings.safety.model_copy(update={"guard": guard})})


def on_robot(scenario: Scenario, settings: Settings) -> None:
    """Run a scenario with the board up and the encoders coming in."""

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def drive(
    robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float, source: str | None = None
) -> None:
    """Repeat a command at 20 Hz, as a client that holds a key does."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, angular_rad_s, source)
        await asyncio.sleep(0.05)


def truth(robot: SimulatedRobot) -> TruthSimulated:
    """What the robot really does."""
    return robot.board.truth(0.0)


def wiretap(robot: SimulatedRobot) -> bytearray:
    """Everything that goes to the board from now on."""
    written, write = bytearray(), robot.device.on_write

    def note(data: bytes) -> None:
        written.extend(data)
        write(data)

    robot.device.on_write = note
    return written


async def topic(robot: SimulatedRobot, name: str) -> dict[str, object]:
    """A topic's latest data."""
    state = await robot.client.call("get_state")
    return state["topics"][name]["data"]


@pytest.mark.parametrize(
    ("linear_m_s", "angular_rad_s"),
    sample([(0.2, 0.0), (-0.2, 0.0), (0.0, 1.0), (0.15, -0.5), (0.03, 0.0)], fast=2),
)
def test_the_robot_moves_as_it_is_told(settings: Settings, linear_m_s: float, angular_rad_s: float):
    """After two seconds of a command the true twist is the one asked for, within 2 % and 3 mm/s."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, linear_m_s, angular_rad_s, 2.0)
        twist = truth(robot).twist
        assert twist.linear_m_s == pytest.approx(linear_m_s, rel=0.02, abs=0.003)
        assert twist.angular_rad_s == pytest.approx(angular_rad_s, rel=0.02, abs=0.01)

    on_robot(scenario, settings)


@pytest.mark.parametrize(
    ("linear_m_s", "angular_rad_s"), sample([(9.0, 0.0), (-9.0, 4.0), (0.1, -30.0), (0.1, 0.2)], fast=2)
)
def test_a_command_is_answered_with_what_the_wheels_then_go_for(
    settings: Settings, linear_m_s: float, angular_rad_s: float
):
    """Too much for the robot or not: after the ramp, the wheels' targets are those of the twist in the answer."""

    async def scenario(robot: SimulatedRobot) -> None:
        answer = await robot.client.drive(linear_m_s, angular_rad_s)
        await drive(robot, linear_m_s, angular_rad_s, 2.0)
        allowed = Twist2D(answer.linear_m_s, answer.angular_rad_s)
        targets = (await topic(robot, "wheels"))["target_rad_s"]
        assert targets == pytest.approx(wheel_speeds_rad_s(Kinematics(settings.chassis), allowed), rel=1e-3)
        assert (answer.limited_by is None) == (allowed == Twist2D(linear_m_s, angular_rad_s))

    lifted = settings.sim.body.model_copy(update={"mass_kg": 0.0})
    sim = settings.sim.model_copy(update={"body": lifted})
    on_robot(scenario, unguarded(settings.model_copy(update={"sim": sim})))


@pytest.mark.parametrize("linear_m_s", sample([0.1, 0.2, -0.2]))
def test_a_step_settles_without_overshoot(settings: Settings, linear_m_s: float):
    """From rest the true speed never exceeds the one asked for by a tenth, and after 1.5 s stays within 2 % of it."""

    async def scenario(robot: SimulatedRobot) -> None:
        speeds = []
        for _ in range(40):
            await drive(robot, linear_m_s, 0.0, 0.05)
            speeds.append(truth(robot).twist.linear_m_s / linear_m_s)
        assert max(speeds) < 1.1
        assert speeds[30:] == pytest.approx([1.0] * 10, rel=0.02)

    on_robot(scenario, unguarded(settings))


@pytest.mark.parametrize("linear_m_s", sample([0.1, 0.25]))
def test_what_feedforward_gets_wrong_is_corrected_within_two_seconds(settings: Settings, linear_m_s: float):
    """On a stand it is too strong; with an integral of three duty ranges per metre the wheels are within 2 %."""
    quick = settings.pid.model_copy(update={"ki": 3.0 * settings.drive.max_duty})
    body = settings.sim.body.model_copy(update={"mass_kg": 0.0})
    lifted = settings.model_copy(update={"pid": quick, "sim": settings.sim.model_copy(update={"body": body})})

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, linear_m_s, 0.0, 2.0)
        wheels = await topic(robot, "wheels")
        assert wheels["velocity_rad_s"] == pytest.approx(wheels["target_rad_s"], rel=0.02)

    on_robot(scenario, unguarded(lifted))


@pytest.mark.parametrize(
    ("linear_m_s", "angular_rad_s"),
    sample([(0.0, 0.3), (0.1, 0.3), (0.1, 0.5), (0.15, -1.0), (0.2, 1.0)], fast=2),
)
def test_a_curve_is_driven_evenly(settings: Settings, linear_m_s: float, angular_rad_s: float):
    """From the third second on, for two seconds, neither speed strays from what is asked by more than a tenth."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, linear_m_s, angular_rad_s, 2.0)
        for _ in range(40):
            await drive(robot, linear_m_s, angular_rad_s, 0.05)
            twist = truth(robot).twist
            assert twist.linear_m_s == pytest.approx(linear_m_s, rel=0.1, abs=0.01)
            assert twist.angular_rad_s == pytest.approx(angular_rad_s, rel=0.1)

    on_robot(scenario, unguarded(settings))


def test_too_fast_a_curve_is_slowed_and_not_straightened(settings: Settings):
    """Unguarded, asked for 1 m/s and 2 rad/s, the wheels give less, but the robot still turns with a radius of 0.5 m."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 1.0, 2.0, 3.0)
        twist = truth(robot).twist
        assert 0.1 < twist.linear_m_s < 0.98
        assert twist.linear_m_s / twist.angular_rad_s == pytest.approx(0.5, rel=0.02)

    on_robot(scenario, unguarded(settings))


def test_full_speed_is_asked_for_by_full_scale_and_no_more(settings: Settings):
    """Asked for 5 m/s, no duty on the wire is beyond the board's full scale: 256 is off on an AVR."""
    full_scale = settings.sim.board.pwm_full_scale

    async def scenario(robot: SimulatedRobot) -> None:
        written = wiretap(robot)
        await drive(robot, 5.0, 0.3, 1.5)
        duties = [abs(int(each)) for line in written.split(b"\r") for each in line.split()[1:]]
        assert full_scale * 0.8 < max(duties) <= full_scale

    on_robot(scenario, unguarded(settings))


@pytest.mark.slow
def test_a_square_closes_and_odometry_knows_where_the_robot_is(settings: Settings):
    """Four sides and four turns by time alone: odometry and truth end within 2 cm and 2 degrees of each other.

    The robot knows its radii and its track. Random slip is 0.7 degrees of a full turn (one sigma).
    """

    async def scenario(robot: SimulatedRobot) -> None:
        for _ in range(4):
            await drive(robot, 0.25, 0.0, 4.0)
            await drive(robot, 0.0, 0.8, math.pi / 2 / 0.8)
        await robot.client.stop()
        await asyncio.sleep(1.0)
        odometry, true = await topic(robot, "odometry"), truth(robot).world_from_base
        assert math.dist((odometry["x_m"], odometry["y_m"]), (true.x_m, true.y_m)) < 0.02
        error_rad = math.remainder(odometry["heading_rad"] - true.heading_rad, math.tau)
        assert abs(error_rad) < math.radians(2.0)

    on_robot(scenario, knowing_its_size(settings))


def test_a_client_that_falls_silent_leaves_the_robot_standing(settings: Settings):
    """One command and no more: within the dead-man (0.25 or 0.5 s) and the braking the robot stands, and stays."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.25, 0.0, 1.0)
        await asyncio.sleep(settings.safety.command_timeout_s + 0.25 + 0.3)
        assert truth(robot).twist.linear_m_s == 0.0
        assert robot.board.duty == still(settings)

    on_robot(scenario, settings)


def test_an_estop_brakes_at_once_and_latches(settings: Settings):
    """Zero is on the wire before the answer; commands are refused by kind; after arm nothing moves by itself."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.25, 0.0, 1.0)
        written = wiretap(robot)
        await robot.client.estop("test")
        assert bytes(written) == stop_line(settings)
        await asyncio.sleep(OBEYED_S)
        assert robot.board.duty == still(settings)
        with pytest.raises(CallError) as refused:
            await robot.client.drive(0.2, 0.0)
        assert refused.value.kind == "estopped"
        await robot.client.arm()
        await asyncio.sleep(1.0)
        assert truth(robot).twist.linear_m_s == 0.0
        await drive(robot, 0.2, 0.0, 1.0)
        assert truth(robot).twist.linear_m_s > 0.1

    on_robot(scenario, settings)


def test_who_arms_clears_no_stop_that_another_client_has_just_pressed():
    """One sees an e-stop; another presses it again; the first one's arm is refused, until it has seen that one, too."""

    async def scenario(robot: SimulatedRobot) -> None:
        await robot.client.estop("smoke")
        seen = (await robot.client.get_state()).safety.latch
        async with Client.connect(*await robot.daemon.server.address()) as other:
            await other.estop("a child")
        with pytest.raises(CallError, match="a child") as refused:
            await robot.client.arm(seen)
        assert refused.value.kind == "latched_again"
        assert (await topic(robot, "safety"))["mode"] == "estopped"
        await robot.client.arm(seen + 1)
        assert (await topic(robot, "safety"))["mode"] == "armed"

    on_robot(scenario, load())


def test_a_higher_source_takes_over_and_gives_back(settings: Settings):
    """The highest source's stop wins while it lasts; the lowest, still talking, then moves the robot again."""

    async def scenario(robot: SimulatedRobot) -> None:
        high, low = strongest(settings), weakest(settings)
        await drive(robot, 0.2, 0.0, 1.0, low)
        for _ in range(20):
            await robot.client.drive(0.0, 0.0, high)
            await drive(robot, 0.2, 0.0, 0.05, low)
        assert truth(robot).twist.linear_m_s == 0.0
        assert (await topic(robot, "safety"))["source"] == high
        await drive(robot, 0.2, 0.0, 1.5, low)
        assert truth(robot).twist.linear_m_s == pytest.approx(0.2, rel=0.02)

    on_robot(scenario, settings)


def test_a_pulled_cable_disarms_and_comes_back_by_itself(settings: Settings):
    """The link is told down and up again within seconds; motion is refused until arm; the board gets a stop first."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        robot.device.unplug()
        await asyncio.sleep(0.5)
        assert (await topic(robot, "link"))["state"] == "down"
        with pytest.raises(CallError) as refused:
            await robot.client.drive(0.2, 0.0)
        assert refused.value.kind == "disarmed"
        robot.device.plug()
        await asyncio.sleep(2.5)
        assert (await topic(robot, "link"))["state"] == "up"
        assert robot.board.duty == still(settings)
        await robot.client.arm()
        await drive(robot, 0.2, 0.0, 1.5)
        assert truth(robot).twist.linear_m_s == pytest.approx(0.2, rel=0.02)

    on_robot(scenario, settings)


def test_odometry_survives_a_board_reset(settings: Settings):
    """After a reset the counters are at zero again; the pose has not moved, and driving goes on from there.

    Of 2 s at 0.2 m/s the ramp of 1 m/s2 takes 0.02 m; the rest is what command and reading are late by.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 2.0)
        await robot.client.stop()
        await asyncio.sleep(1.0)
        before = await topic(robot, "odometry")
        await robot.client.reset_board()
        await asyncio.sleep(3.0)
        assert (await topic(robot, "odometry"))["x_m"] == before["x_m"]
        assert (await robot.client.call("get_stats"))["board_restarts"] == 1
        await robot.client.arm()
        await drive(robot, 0.2, 0.0, 2.0)
        moved_m = (await topic(robot, "odometry"))["x_m"] - before["x_m"]
        cycle_s = settings.sim.board.cycle_s
        late_s = (OBEYED_S if settings.ultrasonic else cycle_s) + cycle_s
        assert moved_m == pytest.approx(2.0 * 0.2 - 0.02 - late_s * 0.2, abs=0.02)

    on_robot(scenario, settings)


@pytest.mark.slow
def test_a_wall_is_met_without_going_through_it(settings: Settings):
    """Without its guard the robot touches the wall and stays on this side; its range sensor saw it coming.

    KHAN's infrared sensor, 0.10 m from the wall it leans on, is beyond its fold: it gives no distance at all.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        beams = []
        for _ in range(20):
            await drive(robot, 0.3, 0.0, 1.0)
            beams += (await topic(robot, "ranges"))["ranges"]
        assert truth(robot).in_contact
        assert next(beam["range_m"] for beam in beams if beam["range_m"] is not None) > 1.0
        end = beams[-1]
        assert end["status"] in ("too_near", "ambiguous") or end["range_m"] < 0.1

    on_robot(scenario, unguarded(settings))


def test_reset_odometry_sets_the_pose(settings: Settings):
    """The pose is what was set, at once."""

    async def scenario(robot: SimulatedRobot) -> None:
        await robot.client.reset_odometry(1.0, 2.0, 0.5)
        odometry = await topic(robot, "odometry")
        assert (odometry["x_m"], odometry["y_m"], odometry["heading_rad"]) == (1.0, 2.0, 0.5)

    on_robot(scenario, settings)


def test_ending_the_daemon_while_driving_stops_the_robot(settings: Settings):
    """Cancelled in mid-drive, the daemon's last word on the wire is a stop."""

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await drive(robot, 0.2, 0.0, 1.0)
            assert robot.board.duty != still(settings)
            written = wiretap(robot)
        assert written.endswith(stop_line(settings))

    run_virtual(run())


def wire_digest(seconds: float) -> str:
    """Drive back and forth and turn; a digest of every byte on the wire, both ways."""
    digest = hashlib.sha256()

    async def run() -> None:
        async with simulated_robot() as robot:
            feed, write = robot.device.transport.feed, robot.device.on_write

            def feed_and_note(data: bytes) -> None:
                digest.update(b"<" + data)
                feed(data)

            def write_and_note(data: bytes) -> None:
                digest.update(b">" + data)
                write(data)

            robot.device.transport.feed = feed_and_note
            robot.device.on_write = write_and_note
            for quarter in range(2):
                await drive(robot, 0.2 if quarter % 2 else -0.2, 0.4, seconds / 4)
                await drive(robot, 0.0, -0.6, seconds / 4)

    run_virtual(run())
    return digest.hexdigest()


@pytest.mark.slow
@pytest.mark.parametrize("seconds", sample([12.0, 60.0]))
def test_a_drive_is_the_same_every_time(seconds: float):
    """Same seed, same commands: every byte on the wire is the same, in both directions."""
    assert wire_digest(seconds) == wire_digest(seconds)
