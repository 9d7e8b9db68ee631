"""The commands ``go``, ``home``, ``dock``, ``patrol``, ``where`` and ``localize``."""

import asyncio
import contextlib
import math
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import NUMBERS_MAY_BE_NEGATIVE, finite
from chefbotd.cli.common.context import CommandContext, beside, run_until_signalled
from chefbotd.cli.common.credentials import credentials
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import ChefbotError, Client
from chefbotd.client.errors import GoalNotReached

if TYPE_CHECKING:
    from chefbotd.components.navigation.cli.view import NavigationScene, Show

T = TypeVar("T")
LOOKED_S = 30.0
OLD_S = 2.0
"""A pose that is older is told with its age."""

NEEDS_LIDAR = "this robot does not navigate: its configuration has no [[lidar]], or [worker] enabled = false"


PATIENCE_S = 1.0
"""A shell that waits longer seems to hang."""


def complete_places(ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    """The names that begin so, whatever the case; none where no daemon answers soon."""
    given = ctx.find_root().params
    if given.get("where") is None:
        return []
    try:
        shown = credentials(
            given.get("token_file"), given.get("ca"), clear_token=bool(given.get("clear_token"))
        )
        context = CommandContext(given["where"], run=ctx.obj or run_until_signalled, credentials=shown)
        names = context.run_with_client(_places)
    except (ProgramError, ChefbotError, click.UsageError, TimeoutError, OSError):
        return []
    return [name for name in names if name.casefold().startswith(incomplete.casefold())]


async def _places(robot: Client) -> list[str]:
    async with asyncio.timeout(PATIENCE_S):
        return [place.name for place in (await robot.list_places()).places]


@click.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument(
    "target", nargs=-1, required=True, metavar="PLACE | X Y [DEG]", shell_complete=complete_places
)
@click.option(
    "--tolerance",
    "tolerance_m",
    type=finite,
    help="If the goal is occupied, stop up to this many metres beside it.",
)
@click.pass_obj
def go(context: CommandContext, target: tuple[str, ...], tolerance_m: float | None) -> None:
    """Send the robot to a place, or to X and Y in metres of the map, with a heading in degrees if one is given.

    The map, the path and the robot are drawn while it drives. Ctrl-C cancels, and the robot stands.
    """
    goal = _goal(target)
    if tolerance_m is not None:
        goal["tolerance_m"] = tolerance_m
    _send(context, lambda robot: robot.navigate_to(**goal), f"to {' '.join(target)}")


@click.command()
@click.pass_obj
def home(context: CommandContext) -> None:
    """Send the robot home: to the place navigation.home_place of the map in use. Ctrl-C cancels."""
    _send(context, lambda robot: robot.go_home(), "home")


@click.command()
@click.pass_obj
def dock(context: CommandContext) -> None:
    """Send the robot to where it is charged: to the place navigation.dock_place of the map in use. Ctrl-C cancels."""
    _send(context, lambda robot: robot.dock(), "to the dock")


def _send(context: CommandContext, drive: Callable[[Client], Awaitable[str]], doing: str) -> None:
    """Have it drive there, and say what came of it."""
    reason = _navigate(context, drive, doing)
    output.say(context.as_json, {"end": "reached", "reason": reason}, f"{reason[:1].upper()}{reason[1:]}.")


def _goal(target: tuple[str, ...]) -> dict[str, Any]:
    """A pose where all words are numbers, two or three; else the name of a place."""
    numbers = []
    with contextlib.suppress(ValueError):
        numbers = [float(word) for word in target]
    if len(numbers) in (2, 3) and all(map(math.isfinite, numbers)):
        headings = [math.radians(math.remainder(degrees, 360)) for degrees in numbers[2:]]
        return dict(zip(("x_m", "y_m", "heading_rad"), [*numbers[:2], *headings], strict=False))
    return {"place": " ".join(target)}


@click.command()
@click.argument("places", nargs=-1, required=True, metavar="PLACE...", shell_complete=complete_places)
@click.option("--rounds", type=click.IntRange(1, 1000), default=1, show_default=True, help="How often.")
@click.pass_obj
def patrol(context: CommandContext, places: tuple[str, ...], rounds: int) -> None:
    """Send the robot to places one after the other. Ctrl-C cancels, and the robot stands."""

    async def drive(robot: Client) -> str:
        reason = ""
        for _ in range(rounds):
            for place in places:
                reason = await robot.navigate_to(place=place)
        return reason

    reason = _navigate(context, drive, f"to {', '.join(places)}")
    count = rounds * len(places)
    output.say(context.as_json, {"goals": count}, f"Reached {count} places; the last: {reason}.")


@click.command()
@click.pass_obj
def where(context: CommandContext) -> None:
    """Show the robot's pose in the map in use, and how certain it is."""
    state = _run(context, lambda robot: robot.call("get_state"))
    if "localization" not in state:
        raise ProgramError(Exit.REFUSED, NEEDS_LIDAR)
    localization, pose = _known_of(state)
    output.say(context.as_json, {"localization": localization, "pose": pose}, _where(localization, pose))


def _known_of(state: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """How localization stands, also before it has told anything, and the pose while it is known."""
    localization, latest = state["localization"], state["topics"].get("map_pose")
    is_known = latest is not None and localization["state"] in ("localized", "uncertain")
    return localization, {**latest["data"], "age_s": latest["age_s"]} if is_known else None


def _where(localization: dict[str, Any], pose: dict[str, Any] | None) -> str:
    on_map = f" on the map {localization['map']}" if localization["map"] else ""
    why = f": {localization['reason']}" if localization["reason"] else ""
    if pose is None:
        others = "".join(
            f"\n  {_at(place)}, fit {place['fit']:.2f}" for place in localization["alternatives"]
        )
        count = len(localization["alternatives"])
        may_be = f"; it may be at {count} place{'s' if count > 1 else ''}" if count else ""
        return f"The robot does not know where it is{on_map} ({localization['state']}{may_be}){why}.{others}"
    was = f"was {pose['age_s']:.0f} s ago" if pose["age_s"] > OLD_S else "is"
    return f"The robot {was} at {_at(pose)}{on_map}: {localization['state']}, fit {localization['fit']:.2f}{why}."


def _at(pose: dict[str, Any]) -> str:
    return f"({pose['x_m']:.2f} m, {pose['y_m']:.2f} m, {math.degrees(pose['heading_rad']):.0f}°)"


@click.command()
@click.option("--turn", is_flag=True, help="Allow one turn on the spot, if the search needs it.")
@click.pass_obj
def localize(context: CommandContext, turn: bool) -> None:
    """Search the whole map for the robot's pose, and wait for the result.

    It does not move, unless --turn allows it to.
    """
    state, reason = _run(context, lambda robot: _look_around(robot, turn=turn))
    localization, pose = _known_of(state)
    if localization["state"] != "localized" or pose is None:
        raise ProgramError(Exit.NOT_DONE, "; ".join(filter(None, (reason, _where(localization, None)))))
    output.say(context.as_json, {"localization": localization, "pose": pose}, _where(localization, pose))


async def _look_around(robot: Client, *, turn: bool) -> tuple[dict[str, Any], str]:
    """The robot's state after it has looked, and turned where it may and had to; and what came of the turn."""
    reason = ""
    if turn:
        reason = (await robot.localize(turn=True)).reason
    else:
        await robot.localize()
        async with robot.subscribe("localization") as events:  # the first one tells how it stands since then
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(LOOKED_S):
                    async for event in events:
                        if event.data.state in ("localized", "lost"):
                            break
    return await robot.call("get_state"), reason


def _navigate(context: CommandContext, drive: Callable[[Client], Awaitable[str]], doing: str) -> str:
    """Run ``drive``, and draw what happens meanwhile.

    Raises:
        ProgramError: a goal was not reached, or any failure.
    """
    from chefbotd.components.navigation.cli.view import NavigationScene, NavigationView

    view = NavigationView(quiet=context.as_json)

    async def driving(robot: Client) -> str:
        with view.showing() as show:
            return await _watch_goal(robot, NavigationScene(doing=doing), show, drive)

    try:
        return _run(context, driving)
    except GoalNotReached as error:
        raise ProgramError(Exit.NOT_DONE, error.reason, end=error.end) from error


async def _watch_goal(
    robot: Client, scene: "NavigationScene", show: "Show", drive: Callable[[Client], Awaitable[str]]
) -> str:
    from chefbotd.components.maps.cli.draw import MapMark
    from chefbotd.components.navigation.cli.view import PLACE, listen

    scene.grid = (await robot.get_map()).grid()
    places = (await robot.list_places()).places
    scene.places = tuple(MapMark(place.x_m, place.y_m, label=place.name, style=PLACE) for place in places)
    async with beside(listen(robot, scene, show)):
        return await drive(robot)


def _run(context: CommandContext, action: Callable[[Client], Awaitable[T]]) -> T:
    return context.run_with_client(action, absent=NEEDS_LIDAR)
