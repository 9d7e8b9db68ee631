"""The sequence of the doctor's checks from power to pose, with a running daemon or without one."""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator
from pathlib import Path

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import Client
from chefbotd.components.doctor.algorithms.finding import problem, skip_check
from chefbotd.components.doctor.algorithms.host import (
    PortFound,
    check_baud,
    check_configuration,
    check_device,
    check_governor,
    check_holder,
    check_permission,
    check_plugins,
    check_priority,
    check_service,
    check_socket,
    check_time_sync,
)
from chefbotd.components.doctor.algorithms.lines import LinesHeard, check_left_on
from chefbotd.components.doctor.cli import host
from chefbotd.components.doctor.cli.asked import examine_with_help
from chefbotd.components.doctor.cli.diagnosis import Diagnosis
from chefbotd.components.doctor.cli.motors import examine_motors
from chefbotd.components.doctor.cli.passive import examine_robot, line_findings
from chefbotd.components.doctor.listening.ports import USUAL_BAUDS, listen, survey
from chefbotd.process.own_daemon import own_daemon
from chefbotd.rpc.parameters import is_loopback

NAME = "chefbotctl doctor"
LOOK_AGAIN_S = 0.05


async def walk(diagnosis: Diagnosis, context: CommandContext, configuration: str) -> None:
    """All of it; ``configuration`` says where the settings are from."""
    where = str(context.address)

    async def with_daemon(robot: Client) -> None:
        diagnosis.find(
            check_configuration(
                configuration, wanted_robot=diagnosis.settings.robot.name, robot=robot.hello.robot
            ),
            check_socket(where, f"{robot.hello.robot}, protocol {robot.hello.protocol}", ""),
        )
        await _examine_computer(diagnosis, context, robot)
        await examine(diagnosis, robot)

    try:
        await context.with_client(with_daemon, name=NAME)
    except ProgramError as failure:
        if failure.code is not Exit.CANNOT_CONNECT:
            raise
        diagnosis.find(
            check_configuration(configuration, wanted_robot=diagnosis.settings.robot.name, robot=""),
            check_socket(where, "", "" if "refused" in str(failure) else f" ({failure})"),
        )
        await _without_daemon(diagnosis, context)


async def examine(diagnosis: Diagnosis, robot: Client, *, rate_is_known: bool = False) -> None:
    """A robot whose daemon answers: listen, drive its wheels if that is wanted, ask."""
    diagnosis.find(*check_plugins((await robot.list_plugins()).plugins))
    await examine_robot(diagnosis, robot, rate_is_known=rate_is_known)
    if (await robot.get_state()).link.state != "up":
        diagnosis.find(
            skip_check("asked", "nothing was asked for and nothing driven: the board is not connected")
        )
        return
    await examine_motors(diagnosis, robot)
    await examine_with_help(diagnosis, robot)


async def _examine_computer(diagnosis: Diagnosis, context: CommandContext, robot: Client | None) -> bool:
    """The computer that the robot is on, if that is ours; whether the board's port could be opened."""
    if robot is not None and not is_loopback(context.address.host):
        where = f"the robot is on {context.address.host}, another computer"
        diagnosis.find(
            skip_check("computer", where, "run the doctor there for its port, its service and its clock")
        )
        return False
    link = diagnosis.settings.link
    if robot is not None:
        held = (await robot.get_state()).link.device
        require_same(diagnosis.wanted_device, held, str(context.address))
        link = link.model_copy(update={"device": held})
    is_free = examine_port(diagnosis, host.look_at_port(link), daemon_answers=robot is not None)
    diagnosis.find(
        check_service(await host.service_unit()),
        check_governor(host.governors()),
        check_priority(
            *host.priority_of(None if robot is None else host.pid_at(context.address.port, link.device)),
            daemon_answers=robot is not None,
        ),
        check_time_sync(await host.is_synchronized()),
    )
    return is_free


def require_same(requested: str | None, held: str, where: str) -> None:
    """See that the board that was named is the one that the daemon drives: else another robot would be driven.

    Raises:
        ProgramError: it is another one.
    """
    if requested is not None and Path(requested).resolve() != Path(held).resolve():
        raise ProgramError(
            Exit.USAGE,
            f"--port {requested}: the daemon at {where} uses {held}, which the doctor would examine; omit --port, "
            "stop the daemon, or give another address with --connect",
        )


async def _without_daemon(diagnosis: Diagnosis, context: CommandContext) -> None:
    if not await _examine_computer(diagnosis, context, None):
        diagnosis.find(
            skip_check(
                "board", "the board's port cannot be opened: mend that first, then ask the doctor again"
            )
        )
        return
    match = await find_baud(diagnosis)
    if match is None:
        return
    baud, heard = match
    diagnosis.find(*check_left_on(heard.duty))
    fits = heard.is_board and heard.wheels == len(diagnosis.settings.chassis.wheels)
    async with _daemon_at(diagnosis, baud) if fits else contextlib.nullcontext() as robot:
        if robot is None:
            diagnosis.find(*line_findings(diagnosis, heard))
            diagnosis.find(skip_check("board", "no more is asked of a board that is not the configured one"))
        else:
            await examine(diagnosis, robot, rate_is_known=True)


@contextlib.asynccontextmanager
async def _daemon_at(diagnosis: Diagnosis, heard_baud: int) -> AsyncIterator[Client]:
    """A daemon of our own on the port, at the rate at which the board was understood."""
    link = diagnosis.settings.link.model_copy(update={"baud": heard_baud})
    settings = diagnosis.settings.model_copy(update={"link": link})
    try:
        async with own_daemon(settings, name=NAME, opener=diagnosis.opener) as robot:
            await _until_linked(robot, diagnosis.settings.link.health_after_s)
            yield robot
    except OSError as error:
        diagnosis.find(problem("open", f"the board's port was lost: {error}", "look at its cable"))


async def _until_linked(robot: Client, patience_s: float) -> None:
    """Until the board is connected, or for long enough to know that it is not."""
    for _ in range(math.ceil(patience_s / LOOK_AGAIN_S)):
        if (await robot.get_state()).link.state == "up":
            return
        await asyncio.sleep(LOOK_AGAIN_S)


LISTEN_S = 2.5
"""A missing ultrasonic echo silences a board for a second, a bootloader for two."""

TRY_S = 1.0


def examine_port(diagnosis: Diagnosis, port: PortFound, *, daemon_answers: bool) -> bool:
    """What is known before the port is opened; whether it can be."""
    diagnosis.find(
        check_device(port),
        check_permission(port),
        check_holder(port, daemon_answers=daemon_answers),
    )
    return port.exists and not port.permission and not port.held_by


async def find_baud(diagnosis: Diagnosis) -> tuple[int, LinesHeard] | None:
    """Listen at the configured rate, and at the others where that is garbage; nothing is written.

    The right rate with what was heard at it, or the configured one; None where the port cannot be opened.
    """
    link = diagnosis.settings.link
    try:
        heard = await _hear(diagnosis, link.baud, LISTEN_S)
        others = USUAL_BAUDS if heard.bytes and not heard.is_board else ()
        for baud in others:
            if baud == link.baud:
                continue
            other = await _hear(diagnosis, baud, TRY_S)
            if other.is_board:
                diagnosis.find(check_baud(link.baud, baud, heard_anything=True))
                return baud, other
    except OSError as error:
        reason = str(error).removeprefix(f"{link.device}: ")
        diagnosis.find(
            problem(
                "open", f"{link.device} cannot be opened: {reason}", "end what holds it, or plug it in again"
            )
        )
        return None
    diagnosis.find(
        check_baud(link.baud, link.baud if heard.is_board else None, heard_anything=heard.bytes > 0)
    )
    return link.baud, heard


async def _hear(diagnosis: Diagnosis, baud: int, seconds: float) -> LinesHeard:
    link = diagnosis.settings.link.model_copy(update={"baud": baud})
    listened = await listen(diagnosis.opener, link, diagnosis.clock, seconds)
    return survey(listened, diagnosis.settings.robot.wire)
