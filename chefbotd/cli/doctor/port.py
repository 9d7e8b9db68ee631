"""The board's port without a daemon: is it there, may we, is it free, and at which rate does a board talk?"""

from chefbotd.cli.doctor.visit import Visit
from chefbotd.doctor.finding import problem
from chefbotd.doctor.host import (
    PortFound,
    check_baud,
    check_device,
    check_holder,
    check_permission,
)
from chefbotd.doctor.lines import LinesHeard
from chefbotd.link.listener import USUAL_BAUDS, listen, survey

LISTEN_S = 2.5
"""A missing ultrasonic echo silences a board for a second, a bootloader for two."""

TRY_S = 1.0


def look(visit: Visit, port: PortFound, *, daemon_answers: bool) -> bool:
    """What is known before the port is opened; whether it can be."""
    visit.find(
        check_device(port),
        check_permission(port),
        check_holder(port, daemon_answers=daemon_answers),
    )
    return port.exists and not port.permission and not port.held_by


async def find_baud(visit: Visit) -> tuple[int, LinesHeard] | None:
    """Listen at the configured rate, and at the others where that is garbage; nothing is written.

    The right rate with what was heard at it, or the configured one; None where the port cannot be opened.
    """
    link = visit.settings.link
    try:
        heard = await _hear(visit, link.baud, LISTEN_S)
        others = USUAL_BAUDS if heard.bytes and not heard.is_board else ()
        for baud in others:
            if baud == link.baud:
                continue
            other = await _hear(visit, baud, TRY_S)
            if other.is_board:
                visit.find(check_baud(link.baud, baud, heard_anything=True))
                return baud, other
    except OSError as error:
        told = str(error).removeprefix(f"{link.device}: ")
        visit.find(
            problem(
                "open", f"{link.device} cannot be opened: {told}", "end what holds it, or plug it in again"
            )
        )
        return None
    visit.find(check_baud(link.baud, link.baud if heard.is_board else None, heard_anything=heard.bytes > 0))
    return link.baud, heard


async def _hear(visit: Visit, baud: int, seconds: float) -> LinesHeard:
    link = visit.settings.link.model_copy(update={"baud": baud})
    listened = await listen(visit.opener, link, visit.clock, seconds)
    return survey(listened, visit.settings.robot.wire)
