"""The board's port without a daemon: is it there, may we, is it free, and at which rate does a board talk?"""

from chefbotd.cli.doctor.diagnosis import Diagnosis
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


def look(diagnosis: Diagnosis, port: PortFound, *, daemon_answers: bool) -> bool:
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
        told = str(error).removeprefix(f"{link.device}: ")
        diagnosis.find(
            problem(
                "open", f"{link.device} cannot be opened: {told}", "end what holds it, or plug it in again"
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
