"""``chefbotctl square``: the robot drives a square over the command socket, and the result is shown.

The robot follows the course by odometry; a simulated robot's true pose is shown too. The drive is good when odometry
ends within 5 cm and 5 degrees of the goal, and the true pose within as much of odometry.
"""

from pathlib import Path

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive import square_view
from chefbotd.cli.drive.course import CourseParameters, square
from chefbotd.cli.drive.course_driver import CourseDriver, CourseResult, problems
from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client


def drive_square(
    context: CommandContext, side_m: float, *, simulated: bool, robot: Path | None = None
) -> None:
    """Drive the square on the daemon of ``context``, or on a new simulation of ``robot``; show and judge the result.

    Raises:
        ProgramError: the robot did not reach the goal.
    """
    view = square_view.View(context.as_json)

    async def drive_course(client: Client) -> CourseResult:
        with view.progress() as report:
            return await CourseDriver(client, CourseParameters(), report).drive_course(square(side_m))

    async def drive_simulation() -> CourseResult:
        view.say("starting chefbotd on a simulated robot ...")
        async with simulated_daemon(robot) as address:
            view.say(f"driving a {side_m:g} m square through {address}")
            return await CommandContext(address).with_client(drive_course)

    result = context.run(drive_simulation() if simulated else context.with_client(drive_course))
    found = problems(result)
    view.show(result, found)
    if found:
        raise ProgramError(Exit.NOT_DONE, "; ".join(found))
