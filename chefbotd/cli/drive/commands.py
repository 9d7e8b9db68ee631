"""The commands of chefbotctl that drive, stop, arm and reset."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import to_builtins

from chefbotd.cli.common import output, state_text
from chefbotd.cli.common.arguments import (
    NUMBERS_MAY_BE_NEGATIVE,
    PHYSICS,
    configuration,
    finite,
    positive,
    wheel_speed,
)
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import need_terminal, tell
from chefbotd.cli.common.exits import Exit, ProgramError, extra
from chefbotd.cli.drive.control import run_as_driver, take_over
from chefbotd.client import Client
from chefbotd.core.geometry import Twist2D

if TYPE_CHECKING:
    from chefbotd.cli.drive.timed_drive import DrivenWheels
import math
from collections.abc import Awaitable, Callable

from chefbotd.cli.drive.control import arm_seen, describe_stop

SPEED, TURNING = click.FloatRange(0.01, 5.0), click.FloatRange(0.01, 20.0)


@click.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("linear_m_s", metavar="V", type=finite)
@click.argument("angular_rad_s", metavar="W", type=finite)
@click.option("--for", "seconds", metavar="S", type=positive, required=True, help="For S seconds.")
@take_over
@click.pass_obj
def drive(
    context: CommandContext, linear_m_s: float, angular_rad_s: float, seconds: float, takes_over: bool
) -> None:
    """Drive at V m/s, turning left at W rad/s, for S seconds.

    It always ends with a stop. Negative numbers go backwards and to the right. A speed beyond the
    robot's limits is reduced, with a message. Exit code 6 means that odometry saw next to no motion.
    """
    from chefbotd.cli.common.console import Printer
    from chefbotd.cli.drive.timed_drive import drive_for

    twist = Twist2D(linear_m_s, angular_rad_s)
    with output.countdown(seconds, Printer(stderr=True, quiet=context.as_json)) as report:
        done = run_as_driver(
            context, "drive", lambda robot: drive_for(robot, twist, seconds, report), takes_over=takes_over
        )
    moved = {"x_m": done.moved.x_m, "y_m": done.moved.y_m, "heading_rad": done.moved.heading_rad}
    allowed = state_text.twist(done.allowed.linear_m_s, done.allowed.angular_rad_s)
    output.say(
        context.as_json,
        {
            "moved": moved,
            "happened": done.happened,
            "allowed": to_builtins(done.allowed),
            **to_builtins(done.told),
        },
        f"{done.told.limit_line(allowed)}Moved, seen from the start: {state_text.pose(done.moved)}",
    )
    if not done.happened:
        reason = "the robot was told to move, but odometry saw next to no motion"
        raise ProgramError(Exit.NOT_DONE, f"{reason}{done.told.limit_suffix}")


@click.command()
@click.option(
    "--side", "side_m", metavar="M", type=positive, default=2.0, show_default=True, help="In metres."
)
@click.option("--sim", "simulated", is_flag=True, help="Start a daemon on a simulated robot for this.")
@click.option(
    "--robot", metavar="NAME", type=configuration, help="Which robot to simulate: a packaged one, or a file."
)
@click.option("--physics", type=PHYSICS, help="What moves the simulated robot; mujoco is an extra.")
@click.pass_obj
def square(
    context: CommandContext, side_m: float, simulated: bool, robot: Path | None, physics: str | None
) -> None:
    """Drive a square, and show how well it closed.

    The square is to the left; the robot follows it by odometry. Poses and latencies are shown. It needs M metres of room
    ahead and to the left. Exit code 6 means that the robot did not reach the goal.
    """
    from chefbotd.cli.drive.square_view import drive_square

    if robot is not None and not simulated:
        raise click.UsageError("--robot chooses what to simulate, and needs --sim")
    if physics is not None and not simulated:
        raise click.UsageError("--physics moves a simulated robot, and needs --sim")
    drive_square(context, side_m, simulated=simulated, robot=robot, physics=physics)


@click.command()
@take_over
@click.pass_obj
def teleop(context: CommandContext, takes_over: bool) -> None:
    """Drive by keyboard; the robot stops when the keys do. A lost connection is opened again."""
    with extra("teleop", "textual"):
        from chefbotd.cli.drive.teleop import teleop as run_screen
    need_terminal()
    run_as_driver(
        context,
        "teleop",
        lambda robot: run_screen(robot, str(context.address)),
        takes_over=takes_over,
        reconnect=True,
    )


@click.command()
@click.option("--source", metavar="NAME", help="The command source; default: joystick, if the robot has it.")
@click.option("--linear", "linear_m_s", metavar="M/S", type=SPEED, default=0.2, show_default=True)
@click.option("--angular", "angular_rad_s", metavar="RAD/S", type=TURNING, default=0.8, show_default=True)
@click.option("--turbo", metavar="FACTOR", type=click.FloatRange(1.0, 10.0), default=2.0, show_default=True)
@click.option("--dead-zone", type=click.FloatRange(0.0, 0.9), default=0.12, show_default=True)
@take_over
@click.pass_obj
def joystick(
    context: CommandContext,
    source: str | None,
    linear_m_s: float,
    angular_rad_s: float,
    turbo: float,
    dead_zone: float,
    takes_over: bool,
) -> None:
    """Drive by gamepad, while its enable button is held.

    The left shoulder button enables, the right one is turbo, the left stick drives. Releasing the enable
    button ends this motion; another driver may go on. X stops the robot, whoever drives; B is the emergency stop; Start
    arms.
    """
    with extra("joystick", "sdl2"):
        from chefbotd.cli.drive.sdl_gamepad import HELP, SdlPad
    from chefbotd.cli.drive.gamepad import StickScale
    from chefbotd.cli.drive.joystick import JoystickPilot

    scale = StickScale(linear_m_s=linear_m_s, angular_rad_s=angular_rad_s, turbo=turbo, dead_zone=dead_zone)
    with SdlPad() as pad:
        tell(HELP)
        run_as_driver(
            context,
            "joystick",
            lambda robot: JoystickPilot(robot, pad, _say, scale, source, takes_over=takes_over).run(),
            takes_over=False,  # the pilot takes control of its own source
        )


def _say(text: str) -> None:
    tell(text)


SUFFIX = "_wheel"
"""The suffix that may be left out of a wheel's name."""


@click.command()
@click.argument("asked", metavar="NAME=RAD_S...", type=wheel_speed, nargs=-1, required=True)
@click.option("--for", "seconds", metavar="S", type=positive, required=True, help="For S seconds.")
@take_over
@click.pass_obj
def wheels(
    context: CommandContext, asked: tuple[tuple[str, float], ...], seconds: float, takes_over: bool
) -> None:
    """Turn wheels each at RAD_S rad/s, for S seconds.

    NAME is a wheel's name, such as left_wheel, or left for short. Forward is positive; wheels that are not named stand.
    It always ends with a stop. A speed beyond the robot's limits is reduced, with a message. Exit code 6 means that
    a wheel turned far less than the limits allow.
    """
    from chefbotd.cli.common.console import Printer
    from chefbotd.cli.drive.timed_drive import turn_for

    if len(dict(asked)) < len(asked):
        raise click.UsageError("each wheel may be named once")
    speeds: dict[str, float] = {}

    async def turn(robot: Client) -> "DrivenWheels":
        speeds.update(_by_wheel(asked, list(await robot.get_pid())))
        return await turn_for(robot, speeds, seconds, report)

    with output.countdown(seconds, Printer(stderr=True, quiet=context.as_json)) as report:
        done = run_as_driver(context, "wheels", turn, takes_over=takes_over)
    allowed = ", ".join(f"{name} {speed:+.2f} rad/s" for name, speed in done.allowed_rad_s.items())
    turned = ", ".join(f"{name} {done.turned_rad_s.get(name, 0.0):+.2f} rad/s" for name in speeds)
    output.say(
        context.as_json,
        {
            "velocity_rad_s": done.turned_rad_s,
            "happened": not done.stuck,
            "allowed_rad_s": done.allowed_rad_s,
            **to_builtins(done.told),
        },
        f"{done.told.limit_line(allowed)}Turned at the end: {turned}",
    )
    if done.stuck:
        names = f"{', '.join(done.stuck)}{done.told.limit_suffix}"
        raise ProgramError(Exit.NOT_DONE, f"these wheels were told to turn, but hardly turned: {names}")


def _by_wheel(asked: Iterable[tuple[str, float]], wheels: Iterable[str]) -> dict[str, float]:
    """The speeds by the wheels' full names; an unknown name is passed on, and the daemon refuses it."""
    short = {wheel.removesuffix(SUFFIX): wheel for wheel in wheels}
    by_wheel: dict[str, float] = {}
    for name, speed in asked:
        wheel = short.get(name.removesuffix(SUFFIX), name)
        if wheel in by_wheel:
            raise click.UsageError(f"each wheel may be named once, and {name} is {wheel} too")
        by_wheel[wheel] = speed
    return by_wheel


def _do(context: CommandContext, act: Callable[[Client], Awaitable[None]], said: str) -> None:
    context.run_with_client(act)
    output.say(context.as_json, {"done": True}, said)


@click.command()
@click.pass_obj
def stop(context: CommandContext) -> None:
    """Stop the robot, whoever drives; a driver is refused until it pauses for a second."""
    drivers = context.run_with_client(lambda robot: robot.stop())
    output.say(context.as_json, {"done": True, "drivers": drivers}, describe_stop(drivers))


@click.command()
@click.option("--reason", help="Why, for whoever arms the robot again.")
@click.pass_obj
def estop(context: CommandContext, reason: str | None) -> None:
    """Stop the robot at once and keep it stopped until 'arm'."""
    _do(context, lambda robot: robot.estop(reason), "Stopped, and locked until 'chefbotctl arm'.")


@click.command()
@click.pass_obj
def arm(context: CommandContext) -> None:
    """Allow motion again after an emergency stop or a fault.

    Only after what has latched when the command begins: a stop that comes after it holds.
    """
    _do(context, arm_seen, "Armed: the robot may move.")


@click.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("x_m", metavar="[X]", type=finite, default=0.0)
@click.argument("y_m", metavar="[Y]", type=finite, default=0.0)
@click.argument("heading_deg", metavar="[DEG]", type=finite, default=0.0)
@click.pass_obj
def reset_odometry(context: CommandContext, x_m: float, y_m: float, heading_deg: float) -> None:
    """Set the robot's pose in odometry; default: the origin.

    X and Y are in metres, DEG is the heading in degrees, counter-clockwise.
    """
    heading_rad = math.radians(heading_deg)
    said = f"Odometry starts from ({x_m:g} m, {y_m:g} m, {heading_deg:g}°)."
    _do(context, lambda robot: robot.reset_odometry(x_m, y_m, heading_rad), said)


RESET_BEGUN = (
    "The board will restart as soon as its motors stand. 'chefbotctl watch reset' shows the progress; "
    "'chefbotctl arm' allows motion again."
)


@click.command()
@click.pass_obj
def reset_board(context: CommandContext) -> None:
    """Restart the robot's board. Send 'arm' afterwards."""
    _do(context, lambda robot: robot.reset_board(), RESET_BEGUN)
