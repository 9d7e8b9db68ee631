"""What happens to the board: it restarts, loses its power, reads nothing, or its clock wraps."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from itertools import groupby

from chefbotd.components.simulation.parameters.sketches import PUBLISHED_SKETCHES
from firmware_protocol.checked import seal
from tests.scenarios.fault_run import ENDED, Expected, Fault, FaultRun
from tests.scenarios.faults.link import PULLED_S, unplugged
from tests.scenarios.faults.outcomes import (
    AT_ONCE_S,
    BOARD_DEAD_MAN_S,
    DRIVES_ON,
    SLACK_S,
    drives_on,
    estopped,
    latched,
)
from tests.scenarios.faults.program import cancelled
from tests.scenarios.faults.wheels import rewired
from tests.scenarios.instruments import is_moving
from tests.scenarios.wires import opened, transport_of

BEGUN_LINE = b"e\t50\t4"
RESET = seal(b"r", 0, b" ") + b"\r"
"""Every board restarts by it: a sketch looks at the first word only."""
REBOOT_S = 0.2
"""From the reset pin until the sketch runs: the bridges are open meanwhile."""

AT_THE_PIN = {"sim.board.reset_delay_s": 0.0, "sim.board.resets": True}
"""A reset by the board's pin, not by the sketch: without the second that it waits, whether or not it would restart."""


def bodies(written: bytes) -> list[bytes]:
    """The commands among the lines that were written, without their seals."""
    lines = [opened(line, b" ")[0] for line in written.split(b"\r") if line]
    return [line for line in lines if not line.startswith(b"hello")]


@asynccontextmanager
async def reset(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board restarts because somebody asks for it: a stop, the reset when the robot stands, and nothing more."""
    async with reset_sequence(fault_run):
        yield


@asynccontextmanager
async def reset_sequence(fault_run: FaultRun, *, stands: bool = True) -> AsyncIterator[None]:
    """The board is asked to restart: no motion from there on, and ``r`` once; the robot ``stands`` then."""
    robot, said, moved_at_reset = fault_run.robot, list[bytes](), list[bool]()
    write = robot.device.on_write

    def hear(data: bytes) -> None:
        said.append(data)
        if b"r" in bodies(data):
            moved_at_reset.append(any(robot.board.duty) or is_moving(robot))
        write(data)

    robot.device.on_write = hear
    await robot.client.reset_board()
    yield
    robot.device.on_write = write
    stop = b"s" + b" 0" * len(robot.board.duty) + b"\r"
    lines = bodies(b"".join(said))
    first, asked = lines.index(stop[:-1]), lines.index(b"r")
    before, after = lines[first:asked], lines[asked + 1 :]
    fault_run.check(set(before) == {stop[:-1]}, f"motion after the stop: {before}")
    fault_run.check(b"r" not in after, "asked twice")
    fault_run.check(not stands or moved_at_reset == [False], "asked before it stood")


@asynccontextmanager
async def reset_without_echo(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, and of the board's echo nothing comes: it is asked after 1.5 s all the same."""
    async with rewired(b"s", lambda _: None, fault_run), reset_sequence(fault_run):
        yield


@asynccontextmanager
async def reset_and_unplugged(fault_run: FaultRun) -> AsyncIterator[None]:
    """The cable is pulled while the stop is waited for: the request is forgotten, and told so."""
    robot, said = fault_run.robot, list[bytes]()
    write = robot.device.on_write
    robot.device.on_write = lambda data: (said.append(data), write(data))[1]
    await robot.client.reset_board()
    async with unplugged(fault_run):
        yield
    robot.device.on_write = write
    fault_run.check(b"r" not in bodies(b"".join(said)), "asked all the same")
    stage = (await fault_run.topic("reset"))["stage"]
    fault_run.check(stage == "link_lost", f"told as {stage}")


@asynccontextmanager
async def reset_by_itself(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board restarts in the middle of a line, as when its voltage sags."""
    transport_of(fault_run.robot).feed(BEGUN_LINE)
    fault_run.robot.board.receive(RESET)
    yield


@asynccontextmanager
async def reset_without_banner(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board restarts and not a word of its banner arrives: only its clock tells."""
    transport = transport_of(fault_run.robot)
    feed = transport.feed
    lines = lambda data: (line for line in data.splitlines(keepends=True) if line[1:2] == b"\t")  # noqa: E731
    transport.feed = lambda data: feed(b"".join(lines(data)))
    fault_run.robot.board.receive(RESET)
    yield
    transport.feed = feed


@asynccontextmanager
async def jammed(fault_run: FaultRun) -> AsyncIterator[None]:
    """A bit of each byte that is written flips on its way."""
    device = fault_run.robot.device
    write = device.on_write
    device.on_write = lambda data: write(bytes(byte ^ 1 for byte in data))
    yield
    device.on_write = write


@asynccontextmanager
async def power_cycle(fault_run: FaultRun) -> AsyncIterator[None]:
    """The cable is pulled, and meanwhile the board loses its power and has it again."""
    before = fault_run.robot.daemon.session.restarts.memory.count
    fault_run.robot.board.receive(RESET)
    async with unplugged(fault_run):
        yield
        fault_run.check(
            fault_run.robot.daemon.session.restarts.memory.count == before + 1, "the restart was not noticed"
        )


NOTICED = {"chefbot": None, "khan": "board_unresponsive"}
"""KHAN's fifty readings a second tell within half a second that the board does not listen; ChefBot's twenty do not."""

NOTICED_LATER: Mapping[str, Expected | str] = {
    "duemilanove": Expected("estopped", "board_unresponsive", 0.5 + AT_ONCE_S)
}
"""It has read on for longer when it comes to the stop: 63 bytes a cycle of what the kernel has taken."""

NO_ESTOP = dict.fromkeys(("", *PUBLISHED_SKETCHES), "its sketch knows no e-stop")

MOST_MOTIONS = 40
"""New motions on their way to a board that says nothing of reading them: 0.2 s of one each 5 ms."""


@asynccontextmanager
async def deaf_board(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board reads nothing for half a second, in which somebody presses stop in earnest."""
    transport = transport_of(fault_run.robot)
    transport.stall()
    asyncio.get_running_loop().call_later(0.5, transport.drain)
    await fault_run.robot.client.estop("smoke")
    yield


@asynccontextmanager
async def deaf_behind_a_buffer(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, but the kernel takes all that is written: repetitions, motions for 0.2 s, what slows, and the stop."""
    device = fault_run.robot.device
    kernel: list[bytes] = []
    in_force = fault_run.robot.board.duty
    read, device.on_write = device.on_write, kernel.append

    def read_again() -> None:
        device.on_write = read
        read(b"".join(kernel))

    await asyncio.sleep(2.0)
    motions = [line for line, _ in groupby(bodies(b"".join(kernel)))]
    others = sum(_is_another(line, in_force) for line in motions)
    fault_run.check(
        len(kernel) > 0 and others <= MOST_MOTIONS,
        f"{others} of {len(kernel)} lines in the kernel are new motions",
    )
    asyncio.get_running_loop().call_later(0.5, read_again)
    await fault_run.robot.client.estop("smoke")
    yield


def _is_another(line: bytes, in_force: tuple[int, ...]) -> bool:
    """Whether a line commands another motion; steps to and fro by one are the encoders' noise, at any rate."""
    duties = [int(field) for field in line.split()[1:]]
    return max(abs(duty - old) for duty, old in zip(duties, in_force, strict=True)) > 1


@asynccontextmanager
async def deaf_at_the_end(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board reads nothing for half a second, in which the program ends: what it then reads has a stop at its end."""
    transport = transport_of(fault_run.robot)
    transport.stall()
    asyncio.get_running_loop().call_later(0.5, transport.drain)
    async with cancelled("drive", fault_run):
        yield


@asynccontextmanager
async def stopped_by_another(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody with a terminal tells the board to stop: it latches there, and the robot is armed to move it again."""
    fault_run.robot.board.receive(b"estop\r")
    yield


@asynccontextmanager
async def half_a_line(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board has half a line of a program that was killed; then somebody presses stop in earnest."""
    fault_run.robot.board.receive(b"s 50")
    await fault_run.robot.client.estop("smoke")
    yield


@asynccontextmanager
async def nothing(fault_run: FaultRun) -> AsyncIterator[None]:
    """What happens is in the overrides."""
    yield


HELD = Expected("armed", None, AT_ONCE_S, ("restart of the board",))
"""A board that has not restarted may be driven, but where its echo is lost nothing faster than standing is sent."""

FAULTS = (
    Fault(
        "Reset asked for while driving",
        "board reset on request",
        reset,
        latched("board_restarted", logged="restart of the board"),
        sketches={"duemilanove": drives_on("restart of the board")},
    ),
    Fault(
        "Reset asked for while driving",
        "board reset on request, echo lost",
        reset_without_echo,
        latched("board_restarted", logged="restart of the board"),
        lasts_s=4.0,
        on_wire=True,
        sketches={"duemilanove": HELD},
    ),
    Fault(
        "Cable pulled",
        "cable pulled in a reset on request",
        reset_and_unplugged,
        latched("link_lost", AT_ONCE_S, "link lost"),
        lasts_s=4.0,
        on_wire=True,
    ),
    Fault(
        "Board restarts",
        "board restarts in the middle of a line",
        reset_by_itself,
        latched("board_restarted", REBOOT_S + SLACK_S, "lines around a fault"),
        on_wire=True,
        overrides=AT_THE_PIN,
    ),
    Fault(
        "Board restarts",
        "board restarts without a banner",
        reset_without_banner,
        latched("board_restarted", REBOOT_S + SLACK_S),
        on_wire=True,
        overrides=AT_THE_PIN,
    ),
    Fault(
        "Cable and power out",
        "cable and power out for 1 s",
        power_cycle,
        latched("link_lost", PULLED_S),
        lasts_s=4.0,
        on_wire=True,
        overrides=AT_THE_PIN,
    ),
    *(
        Fault(
            row,
            f"{name}: {robot}",
            inject,
            Expected("estopped", kind, 0.5 + AT_ONCE_S),
            robots=(robot,),
            sketches=sketches,
        )
        for row, name, inject, sketches in (
            ("Board does not read", "board reads nothing for 0.5 s", deaf_board, {}),
            (
                "Board talks but no longer reads",
                "board reads nothing, the kernel takes all",
                deaf_behind_a_buffer,
                NOTICED_LATER,
            ),
        )
        for robot, kind in NOTICED.items()
    ),
    Fault(
        "The same, while the program ends",
        "board reads nothing, the program ends",
        deaf_at_the_end,
        Expected(ENDED, None, 0.5 + AT_ONCE_S),
    ),
    Fault(
        "Board stops by itself",
        "the board is stopped by somebody else",
        stopped_by_another,
        latched("board_stopped"),
        robots=("chefbot",),
        sketches=NO_ESTOP,
    ),
    Fault(
        "Line to the board jammed",
        "every byte to the board damaged",
        jammed,
        latched("commands_lost", BOARD_DEAD_MAN_S),
        on_wire=True,
        robots=("chefbot",),
        sketches=dict.fromkeys(("", *PUBLISHED_SKETCHES), "its sketch does not say that it hears nothing"),
    ),
    Fault("Stop behind a line that was cut short", "estop behind half a line", half_a_line, estopped()),
    Fault(
        "Board's clock wraps",
        "board's clock wraps",
        nothing,
        DRIVES_ON,
        overrides={"sim.board.boot_micros": 2**32 - 3_000_000},
    ),
)
