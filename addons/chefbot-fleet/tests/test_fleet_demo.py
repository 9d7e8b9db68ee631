"""The demonstration: real broker and manager; with discs for robots it is quick, with ChefBots it is what users see."""

import asyncio
import os
import shutil
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from chefbot_fleet.demo.programs import Program
from chefbot_fleet.demo.report import Measured, report
from chefbot_fleet.demo.story import Demonstration
from chefbot_fleet.roadmap import Point
from fleet_discs import SPEED_M_S, DiscRobot

from chefbotd.components.simulation.truth_file import Truth
from chefbotd.core.geometry import Pose2D
from chefbotd.transport.ports import reserve_port


def need_mosquitto() -> None:
    """Without a broker there is nothing to show; where everything has to be there, that is a failure."""
    if shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin") is None:
        if os.environ.get("ADDONS_TESTS") == "required":
            pytest.fail("mosquitto is not installed: make addons-tools")
        pytest.skip("mosquitto is not installed")


@pytest.mark.realtime
def test_every_order_is_done_once_whoever_is_killed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three discs, six orders; a robot, the broker and the manager are killed, and all of them come back."""
    need_mosquitto()
    shown = Demonstration(
        tmp_path, DiscRobot, robots=3, count=6, page_port=reserve_port(), speed_m_s=SPEED_M_S, gone_s=3.0
    )
    assert asyncio.run(shown.run())
    told = capsys.readouterr().out
    for what in ("r2 is switched off", "r2 is switched on", "The broker is killed", "The manager is killed"):
        assert what in told
    assert "6 orders in" in told
    assert "0 loads and unloads lost, 0 done twice, 0 elsewhere; 0 touches" in told


@pytest.mark.realtime
def test_an_order_that_does_not_end_fails_the_demonstration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The one robot refuses every way: after five seconds without an end to any order, it is given up and counted."""
    need_mosquitto()

    def refusing(serial: str, start: Point, folder: Path, broker_port: int) -> DiscRobot:
        robot = DiscRobot(serial, start, folder, broker_port)
        robot.barred = "a test"
        return robot

    shown = Demonstration(
        tmp_path, refusing, robots=1, count=2, page_port=reserve_port(), speed_m_s=SPEED_M_S, gives_up_s=5.0
    )
    assert not asyncio.run(shown.run())
    told = capsys.readouterr().out
    assert "Given up: no order has ended for 5 s" in told
    assert "4 loads and unloads lost" in told


def test_a_program_that_ends_at_its_start_says_why(tmp_path: Path) -> None:
    """Its log is gone with the demonstration: the last line of it is the error."""
    words = (
        sys.executable,
        "-c",
        "print('starting'); raise SystemExit('there is no C compiler: install one')",
    )
    program = Program(tmp_path / "robot.log", *words, port=reserve_port())
    with pytest.raises(
        click.ClickException, match=r"python\S* has ended: there is no C compiler: install one$"
    ):
        asyncio.run(program.start())


@pytest.mark.slow
@pytest.mark.realtime
def test_simulated_chefbots_bring_their_orders(tmp_path: Path) -> None:
    """Two robots, each its own daemon, worker and agent, and two orders, as ``make fleet`` has six and sixty."""
    need_mosquitto()
    words = (
        "--robots",
        "2",
        "--orders",
        "2",
        "--pace",
        "100",
        "--port",
        str(reserve_port()),
        "--logs",
        str(tmp_path / "logs"),
    )
    done = subprocess.run(
        [sys.executable, "-m", "chefbot_fleet.demo", *words],
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 loads and unloads lost, 0 done twice, 0 elsewhere; 0 touches" in done.stdout


ORDERS = {"order 1": ("counter", "table")}
PLACES = {"counter": (0.0, 0.0), "table": (4.0, 0.0)}
LOADED, TAKEN = ("Please load order 1 on me.", (0.1, 0.0)), ("Please take order 1 from me.", (4.0, 0.1))


@pytest.mark.parametrize(
    ("worked", "passed", "told"),
    [
        ([LOADED, TAKEN], True, "0 loads and unloads lost, 0 done twice, 0 elsewhere"),
        ([LOADED], False, "1 loads and unloads lost, 0 done twice, 0 elsewhere"),
        ([LOADED, TAKEN, TAKEN], False, "0 loads and unloads lost, 1 done twice, 0 elsewhere"),
        ([LOADED, (TAKEN[0], (3.0, 0.0))], False, "0 loads and unloads lost, 0 done twice, 1 elsewhere"),
    ],
)
def test_what_was_lost_done_twice_or_done_elsewhere_is_counted(
    worked: list[tuple[str, tuple[float, float]]],
    *,
    passed: bool,
    told: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """From what people were asked for, and where the robot stood; any of them fails the demonstration."""
    assert report(Measured(["r1"]), ORDERS, {"r1": worked}, PLACES) is passed
    assert told in capsys.readouterr().out


def at(stamp_s: float, x_m: float, touches: int = 0) -> Truth:
    """A robot on the x axis."""
    return Truth(stamp_s, Pose2D(x_m, 0.0, 0.0), np.zeros((1, 3)), touches)


def test_ways_waits_and_touches_are_measured_by_the_robots_clock() -> None:
    """r1 drives 2 m while r2, 3 m and then 1 m away, waits for 2 of 4 s and is touched once; r2 begins anew at 0."""
    measured = Measured(["r1", "r2"])
    measured.take({"r1": at(10.0, 0.0), "r2": at(10.0, 3.0)})
    measured.waits({"r2"})
    measured.take({"r1": at(12.0, 2.0), "r2": None})
    measured.waits(set())
    measured.take({"r1": at(14.0, 2.0), "r2": at(14.0, 3.0, touches=1)})
    measured.take({"r1": at(14.0, 2.0), "r2": at(14.0, 3.0, touches=0)})
    assert measured.driven_m == {"r1": 2.0, "r2": 0.0}
    assert measured.waited_s == {"r1": 0.0, "r2": 2.0}
    assert measured.touches == {"r1": 0, "r2": 1}
    assert (measured.nearest_m, measured.seconds) == (1.0, 4.0)


def test_a_touch_fails_the_demonstration(capsys: pytest.CaptureFixture[str]) -> None:
    """Though every order was done; it says when, and where all robots were."""
    measured = Measured(["r1", "r2"])
    measured.take({"r1": at(0.0, 0.0), "r2": at(0.0, 2.0)})
    measured.take({"r1": at(3.0, 1.6, touches=1), "r2": None})
    assert not report(measured, ORDERS, {"r1": [LOADED, TAKEN]}, PLACES)
    told = capsys.readouterr().out
    assert "1 touches" in told
    assert "r1 touched something after 3 s: r1 (1.60, 0.00), r2 (2.00, 0.00)" in told
