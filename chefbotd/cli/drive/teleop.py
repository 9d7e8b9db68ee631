"""The screen of ``chefbotctl teleop``: keys go to the pilot, telemetry is drawn; needs the extra ``teleop``."""

import asyncio
from collections.abc import Coroutine
from typing import Any, ClassVar

from rich.table import Table
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Static

from chefbotd.cli.common import state_text
from chefbotd.cli.common.screen import RobotScreen
from chefbotd.cli.common.state_text import Fact, Style
from chefbotd.cli.drive.control import Pilot
from chefbotd.cli.drive.keys import ARM_KEY, release_keys
from chefbotd.client import Client, ConnectionLost, Event
from chefbotd.core.record import replace
from chefbotd.rpc.encoding import plain

TOPICS = ("odometry", "wheels", "imu", "ranges", "battery", "link", "safety")
SHOWN_HZ = 10.0
PING_PERIOD_S = 0.5
LOST = Fact("daemon", "connection lost, trying again", Style.ALARM)
ESTOP_KEYS = {"escape", "!", "backspace", "delete"}
HELP = """\
       w         u   i   o
   a   s   d     j   k   l
   the arrows    m   ,   .

  space k  stop
  Esc ! ⌫  emergency stop
  F2       arm
  t        take control
  + -      both speeds ±10 %
  r f      forward speed
  y h      turning speed
  Ctrl-C Q quit

  Any other key stops, too."""


class Teleop(RobotScreen):
    """Drives one robot."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("ctrl+c,ctrl+q,Q", "leave", priority=True)]
    CSS: ClassVar[str] = (
        RobotScreen.BASE_CSS
        + """
    #facts { width: 1fr; height: 1fr; padding: 1 0 1 1; }
    #help { width: 32; padding: 1 0; color: $text-muted; border-left: solid $primary; height: 1fr; }
    """
    )

    def __init__(self, robot: Client, address: str, *, reconnects: bool = False) -> None:
        super().__init__(robot, address, reconnects=reconnects)
        self._pilot = Pilot(robot, self.say)
        self._latest: dict[str, Event[Any]] = {}
        self._arrived_s: dict[str, float] = {}
        self._round_trip_s: float | None = None

    def compose(self) -> ComposeResult:
        """Textual: title, the facts beside the keys, and a line for messages."""
        yield Static(self.heading, id="title")
        with Horizontal():
            yield Static(id="facts")
            yield Static(HELP, id="help", markup=False)
        yield Static(id="message", markup=False)

    async def on_mount(self) -> None:
        """Textual: the screen is there, so begin."""
        self.run_tasks(self._send_commands(), self._read_events(), self._measure())
        self.draw_at(SHOWN_HZ, self._draw)

    async def on_app_blur(self) -> None:
        """Textual: the terminal lost the focus, so a released key would not be noticed."""
        self._pilot.release()

    async def on_key(self, event: events.Key) -> None:
        """Textual: a key arrived, or was repeated."""
        key = event.character if event.is_printable and event.character else event.key
        self.say("")
        if key in ESTOP_KEYS:
            await self._interrupt(self.robot.estop("asked by teleop"), "Emergency stop; F2 arms again.")
        elif key == ARM_KEY:
            safety = self._latest.get("safety")
            seen = None if safety is None else safety.data.latch
            await self._interrupt(self.robot.arm(seen), "Armed.")
        elif key == "t":
            await self.ask(self.robot.take_control(), "You have control; the previous driver's motion ends.")
        else:
            self._pilot.press(key)

    async def _send_commands(self) -> None:
        """Send the keys' commands. After a lost connection no key counts as held: the command was withdrawn."""
        while True:
            try:
                await self._pilot.run()
            except ConnectionLost as loss:
                before, self._pilot = self._pilot, Pilot(self.robot, self.say)
                self._pilot.keys = release_keys(before.keys)
                await self.wait_for_connection(loss)
                self._pilot.keys = release_keys(self._pilot.keys)

    async def _interrupt(self, request: Coroutine[Any, Any, None], done: str) -> None:
        self._pilot.release()
        await self.ask(request, done)

    async def _read_events(self) -> None:
        async with self.robot.subscribe(TOPICS, max_rate_hz=SHOWN_HZ) as events:
            async for event in events:
                self._latest[event.topic] = event
                self._arrived_s[event.topic] = self.now_s()

    async def _measure(self) -> None:
        while True:
            sent_s = self.now_s()
            try:
                await self.robot.ping()
            except ConnectionLost as loss:
                self._round_trip_s = None
                await self.wait_for_connection(loss)
                continue
            self._round_trip_s = self.now_s() - sent_s
            await asyncio.sleep(PING_PERIOD_S)

    def _draw(self) -> None:
        table = Table.grid(padding=(0, 2))
        for fact in self._facts():
            table.add_row(Text(fact.label, style=Style.FAINT), Text(fact.text, style=fact.style))
        self.query_one("#facts", Static).update(table, layout=False)

    def _facts(self) -> list[Fact]:
        keys, asked = self._pilot.keys, self._pilot.asked
        facts = state_text.of_topics({topic: self._aged(topic) for topic in TOPICS if topic in self._latest})
        trip = "-" if self._round_trip_s is None else f"{1000 * self._round_trip_s:.1f} ms round trip"
        if not self.robot.connected:
            facts = [LOST, *(replace(fact, style=Style.FAINT) for fact in facts)]
        return [
            *facts,
            Fact("asked", state_text.twist(asked.linear_m_s, asked.angular_rad_s)),
            Fact("keys", f"{keys.linear_m_s:.2f} m/s  {keys.angular_rad_s:.2f} rad/s"),
            Fact("latency", trip),
        ]

    def _aged(self, topic: str) -> dict[str, Any]:
        event = self._latest[topic]
        return {"data": plain(event.data), "age_s": event.age_s + self.now_s() - self._arrived_s[topic]}


async def teleop(robot: Client, address: str) -> None:
    """Drive by keyboard until the user quits; raises the client error that ended it, if any."""
    await Teleop(robot, address, reconnects=True).show()
