"""The whole demonstration on a virtual clock, with a robot that does as it is told, or does not."""

import io
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from rich.console import Console

from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive import square_view
from chefbotd.cli.drive.course import square
from chefbotd.cli.drive.course_driver import (
    CourseDriver,
    CourseProgress,
    CourseResult,
    Latencies,
    LegEnd,
    problems,
)
from chefbotd.cli.drive.square_view import SquareView
from chefbotd.client import Client
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import replace
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control


def drive(daemon: FakeDaemon, seen: list[CourseProgress], legs: int = 8, **limits: float) -> CourseResult:
    """A 2 m square over the socket, or the first legs of it."""

    async def main() -> CourseResult:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            return await CourseDriver(robot, seen.append, **limits).drive_course(square(2.0)[:legs])

    return daemon.run(main())


@dataclass
class Driven:
    """A square that is done, what was told meanwhile, and the daemon that it was driven on."""

    done: CourseResult
    seen: list[CourseProgress]
    daemon: FakeDaemon


@pytest.fixture(scope="module")
def driven() -> Iterator[Driven]:
    """One for all the tests that only look at it."""
    fake, seen = FakeDaemon(), list[CourseProgress]()
    yield Driven(drive(fake, seen), seen, fake)
    fake.close()


def test_a_square_over_the_socket(driven: Driven) -> None:
    """Eight legs and a rest, each mark where it should be, in less than 75 s, ending with zero and its source free."""
    done, daemon = driven.done, driven.daemon
    assert [mark.name for mark in done.marks] == [
        "side 1", "turn 1", "side 2", "turn 2", "side 3", "turn 3", "side 4", "turn 4", "at rest",
    ]  # fmt: skip
    assert problems(done) == []
    assert done.seconds < 75
    assert daemon.methods()[-3:] == ["drive", "release_control", "unsubscribe"]
    assert daemon.twist.linear_m_s == daemon.twist.angular_rad_s == 0


def test_truth_is_seen_from_the_start(driven: Driven) -> None:
    """The true pose starts elsewhere in its world, and is compared from where the robot started."""
    end = driven.done.marks[-1]
    assert end.true is not None
    assert (end.true.x_m, end.true.y_m) == pytest.approx((end.odometric.x_m, end.odometric.y_m), abs=1e-6)


def test_progress_is_told(driven: Driven) -> None:
    """Every leg is reported, and its share grows from nothing to nearly all."""
    seen = driven.seen
    assert {now.leg for now in seen} == set(range(8))
    first = [now.share for now in seen if now.leg == 0]
    assert first == sorted(first)
    assert first[0] < 0.02
    assert first[-1] > 0.99


def test_latencies_are_measured(driven: Driven) -> None:
    """Pings go out ten times a second; an event stamped 4 ms before it was sent is 4 ms old on arrival."""
    done = driven.done
    assert len(done.latencies.pings) == pytest.approx(10 * done.seconds, rel=0.3)
    assert done.latencies.ages_s()[0] == pytest.approx(0.004)


def test_slip_is_noticed(daemon: FakeDaemon) -> None:
    """Wheels that slip by 10 % leave the robot 20 cm short of a 2 m side, and that is a problem."""
    daemon.slip = 0.1
    done = drive(daemon, [], legs=1)
    side = replace(done, marks=done.marks[:1])
    assert side.marks[0].odometric.x_m == pytest.approx(2.0, abs=0.005)
    (problem,) = problems(side)
    assert problem.startswith(("the robot really ended 199", "the robot really ended 200"))


def test_an_open_square_is_noticed(driven: Driven) -> None:
    """Odometry that ended 10 cm from the goal is a problem of its own."""
    done = driven.done
    end = replace(
        done.marks[-1], commanded=done.marks[-1].odometric.compose(Pose2D(0.1, 0.0, 0.1)), true=None
    )
    (problem,) = problems(replace(done, marks=(end,)))
    assert problem == "odometry says that the robot ended 100.0 mm and 5.73° from the goal"


def test_a_robot_that_does_not_move(daemon: FakeDaemon) -> None:
    """A side on which it comes no nearer for 3 s is given up, by its name, and zero is commanded."""
    daemon.stuck = True
    with pytest.raises(ProgramError, match=r"side 1: 2.00 m are left, and no nearer for 3 s") as caught:
        drive(daemon, [], patience_s=3.0)
    assert caught.value.code is Exit.NOT_DONE
    assert "release_control" in daemon.methods()
    assert daemon.twist.linear_m_s == daemon.twist.angular_rad_s == 0


def test_a_course_that_takes_too_long(daemon: FakeDaemon) -> None:
    """The whole course has a limit of its own."""
    with pytest.raises(ProgramError, match="not finished within 3 s"):
        drive(daemon, [], time_limit_s=3.0)


def test_a_robot_without_odometry(daemon: FakeDaemon) -> None:
    """Without a first reading the robot is never told to move."""
    daemon.silent = True
    with pytest.raises(ProgramError, match="no odometry for 10 s"):
        drive(daemon, [])
    assert "drive" not in daemon.methods()


def test_the_command(control: Control) -> None:
    """In a file the demonstration prints its legs, the poses, the latencies and how it closed."""
    result = control("square", "--side", "0.5")
    assert result.exit_code == 0
    for words in ("side 4 of 4: from", "at rest", "commanded", "ping round trip", "truth within 0.0 mm"):
        assert words in " ".join(result.stdout.split())


def test_the_command_as_json(control: Control, daemon: FakeDaemon) -> None:
    """As JSON it prints marks, seconds, latencies and problems; without a simulator no truth."""
    daemon.simulated = False
    answer = json.loads(control("--json", "square", "--side", "0.5").stdout)
    assert answer["problems"] == []
    assert answer["marks"][-1]["true"] is None
    assert set(answer["latencies"]["ping round trip"]) == {"p50_ms", "p95_ms", "p99_ms"}


def test_a_bad_square_is_a_failure(control: Control, daemon: FakeDaemon) -> None:
    """A robot that ended elsewhere makes the command fail, after it has shown where."""
    daemon.drift_rad_s = 0.01
    result = control("square", "--side", "0.5")
    assert result.exit_code == Exit.NOT_DONE
    assert "at rest" in result.stdout
    assert "the robot really ended" in result.stderr


def test_live_progress() -> None:
    """On a terminal the leg and the pose are drawn as they change."""
    screen = Console(file=io.StringIO(), force_terminal=True, width=100)
    with SquareView(False, screen).progress() as report:
        report(CourseProgress(2, 8, "side 2", 0.5, Pose2D(2.0, 1.0, math.pi / 2)))
    assert isinstance(screen.file, io.StringIO)
    assert "side 2" in screen.file.getvalue()
    assert "x +2.000 m  y +1.000 m  heading +90.0°" in screen.file.getvalue()


def test_addresses_are_written_as_they_are_read() -> None:
    """An IPv6 address keeps its brackets."""
    assert str(Address("::1", 80)) == "[::1]:80"


def test_the_numbers_of_poses_stand_below_each_other() -> None:
    """Headings of 0.0, -90.5 and +180.0 degrees: in every row each number ends in the column it ends in above."""
    told = [
        square_view._brief(Pose2D(x_m, -x_m / 3, math.radians(heading_deg)))
        for x_m, heading_deg in ((0.0, 0.0), (-12.5, -90.5), (1.999, 180.0))
    ]
    ends = [[match.end() for match in re.finditer(r"\S+", text)] for text in told]
    assert ends == [[7, 15, 22]] * 3


def test_a_pose_stays_in_one_line_on_a_terminal_of_80_columns() -> None:
    """The table of a 12 m square: its head, a rule and a line for the leg."""
    pose = Pose2D(-12.5, -12.5, math.pi)
    result = CourseResult((LegEnd("at rest", pose, pose, pose),), Latencies(), 1.0)
    screen = Console(file=io.StringIO(), width=80)
    screen.print(square_view.poses(result))
    assert isinstance(screen.file, io.StringIO)
    lines = [line for line in screen.file.getvalue().splitlines() if line.strip()]
    assert [line.split()[0] for line in lines] == ["x", "─" * 80, "at"]
