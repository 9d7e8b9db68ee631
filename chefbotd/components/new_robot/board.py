"""Finds the robot's board among the serial ports, and what it sends."""

from collections.abc import AsyncIterator, Callable, Mapping, Sequence

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.clock import Clock
from chefbotd.components.doctor.algorithms.lines import NAMES, LinesHeard
from chefbotd.components.doctor.listening.ports import Behind, SerialPort, listen, look_behind, survey
from chefbotd.components.new_robot.answers import FoundValue
from chefbotd.components.new_robot.interview import Interview
from chefbotd.core.record import Record
from chefbotd.link.port import LinkParameters
from chefbotd.link.reconnect import Opener

LISTEN_S = 5.0
NO_BOARD = "none"
CLASSIC = "classic"
BASES: Mapping[int, str] = {2: "chefbot", 4: "khan"}
"""The packaged robot that a file extends, by the number of wheels on the board's lines."""

ABSENT = {"u": "ultrasonic", "i": "imu", "b": "battery", "a": "infrared"}
"""The section of the sensor that each kind of line is for."""


class Serial(Record, frozen=True):
    """How ports are listed and opened."""

    ports: Callable[[], Sequence[SerialPort]]
    opener: Opener
    clock: Clock

    def behind(self, ports: Sequence[SerialPort]) -> AsyncIterator[Behind]:
        """What is behind each of these ports."""
        return look_behind(ports, self.opener, self.clock)


class Found(Record, frozen=True):
    """The board's port (None: there is no board) and its lines, and the lidars that were found beside it."""

    link: LinkParameters | None = None
    heard: LinesHeard = LinesHeard(0.0)
    lidars: tuple[Behind, ...] = ()

    @property
    def base(self) -> str:
        """The packaged robot to extend."""
        return BASES.get(self.heard.wheels, "chefbot")

    @property
    def answers(self) -> dict[str, FoundValue]:
        """What the configuration says of the board and its lines."""
        if self.link is None:
            return {}
        lines = ", ".join(f"{kind} {rate:.0f} a second" for kind, rate in self.heard.rates_hz.items())
        answers = {
            "link.device": FoundValue(self.link.device, "where the board was found"),
            "link.baud": FoundValue(self.link.baud, "at which its lines were understood"),
            "robot.wire": FoundValue(self.heard.wire, f"the board sends {lines}"),
        }
        if self.heard.firmware:
            answers["encoders.counted_by"] = FoundValue("firmware", "our own firmware counts all four edges")
        return answers

    @property
    def absent(self) -> list[str]:
        """The sensors of which the board sends no line."""
        if self.link is None:
            return []
        return [section for kind, section in ABSENT.items() if not self.heard.sends(kind)]


async def find_board(interview: Interview, serial: Serial, named_device: str | None) -> Found:
    """Look behind every port, have one chosen where there are several, and listen to it.

    Raises:
        ProgramError: the port that was named cannot be opened, or no board's lines come from it.
    """
    ports = [SerialPort(named_device)] if named_device else serial.ports()
    if not ports:
        interview.say(
            "No serial port was found: is the board plugged in (a charging cable has no data lines)? If lsusb lists it, "
            "its driver is missing, or brltty has taken it. A port that is not listed is named with --port."
        )
        return Found()
    interview.say(f"Listening at {', '.join(port.device for port in ports)}; this takes up to 10 s a port.")
    behind = []
    async for one in serial.behind(ports):
        interview.say(f"  {one.device}: {one.told}" + (f", {one.baud} baud" if one.baud else ""))
        behind.append(one)
    boards = [one for one in behind if one.kind == "board"]
    lidars = tuple(one for one in behind if one.kind in ("ld06_ld19", "rplidar"))
    if named_device and not boards:
        raise ProgramError(
            Exit.FAILED, f"{named_device}: {behind[0].told}; docs/protocol.md says what a board sends"
        )
    if not boards:
        interview.say(
            "No board was heard. Without one you can type what you know, and nothing is measured. "
            "Is it at another port? Ctrl-C, and name that one with --port."
        )
        return Found(lidars=lidars)
    board = boards[0]
    if len(boards) > 1:
        words = [one.device for one in boards]
        chosen = await interview.choice("Which of them is the robot's board?", [*words, NO_BOARD], words[0])
        if chosen == NO_BOARD:
            return Found(lidars=lidars)
        board = next(one for one in boards if one.device == chosen)
    port = next(port for port in ports if port.device == board.device)
    link = LinkParameters(device=port.by_id or port.device, baud=board.baud or 115_200)
    heard = survey(await listen(serial.opener, link, serial.clock, LISTEN_S), CLASSIC)
    _report(interview, heard)
    return Found(link, heard, lidars)


def _report(interview: Interview, heard: LinesHeard) -> None:
    """Say which lines come and how often, and what is wrong with any."""
    interview.say("The board sends, each second:")
    for kind, rate_hz in heard.rates_hz.items():
        interview.say(f"  {kind}  {rate_hz:5.1f}  {NAMES.get(kind, '')}")
    if missing := [f"{kind} ({NAMES[kind]})" for kind in ("e", "s", "t") if not heard.sends(kind)]:
        interview.say(
            f"It does not send {', '.join(missing)}: docs/protocol.md says what each is needed for."
        )
    for problem in (*heard.formats.values(), heard.clock_unit):
        if problem:
            interview.say(f"Problem: {problem}")
