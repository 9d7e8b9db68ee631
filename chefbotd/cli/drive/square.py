"""The demonstration: a robot drives a square over the command socket, and what came of it is shown.

The course is closed over odometry. A simulated robot's true pose is shown beside it; the drive is good when the
robot really is where odometry says (within 5 cm and 5 degrees) and odometry closes the square as well as that.
"""

from pathlib import Path

from chefbotd.cli.common.context import Conversation
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive import square_view
from chefbotd.cli.drive.course import CourseParameters, square
from chefbotd.cli.drive.course_driver import Walk, Walker, problems
from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client


def drive_square(chat: Conversation, side_m: float, *, simulated: bool, robot: Path | None = None) -> None:
    """Drive (on the daemon of ``chat``, or on a simulation of ``robot`` of its own), show, and judge.

    Raises:
        ProgramError: the robot ended elsewhere than it should, or the drive did not come to its end.
    """
    view = square_view.View(chat.as_json)

    async def talk(client: Client) -> Walk:
        with view.progress() as report:
            return await Walker(client, CourseParameters(), report).walk(square(side_m))

    async def talk_to_simulation() -> Walk:
        view.say("starting chefbotd on a simulated robot ...")
        async with simulated_daemon(robot) as address:
            view.say(f"driving a {side_m:g} m square through {address}")
            return await Conversation(address).connected(talk)

    walk = chat.run(talk_to_simulation() if simulated else chat.connected(talk))
    found = problems(walk)
    view.show(walk, found)
    if found:
        raise ProgramError(Exit.NOT_DONE, "; ".join(found))
