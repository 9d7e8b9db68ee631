"""The screen of ``chefbotctl pid tune``: plots of the wheels while keys change the gains; needs the extra ``tune``."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, cast

from rich.table import Table
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Static

from chefbotd.cli.common.screen import RobotScreen
from chefbotd.cli.common.state_text import Style
from chefbotd.cli.drive.control import arm_seen
from chefbotd.cli.drive.keys import ARM_KEY
from chefbotd.client import Client
from chefbotd.client.methods import Gains
from chefbotd.components.tuning.cli.excitation import Exciter, Wave
from chefbotd.components.tuning.cli.gain_steps import (
    COARSE,
    FINE,
    FIRST_STEP,
    Gain,
    restore_commands,
    step_gain,
)
from chefbotd.components.tuning.cli.plots import PANELS, SHOWN_S, Trace, WheelPlot, assign_colours
from chefbotd.components.tuning.gains_file import save
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.encoding import plain
from chefbotd.settings import SettingsError

ALL_WHEELS = "all"
SHOWN_HZ = 10.0
GAINS_PERIOD_S = 1.0
"""Period at which gains changed by other clients are read."""

NAMES = (*FIRST_STEP, "conditional_integration")
HELP = """\
↑ ↓  gain     ← → ±10 %
Tab  wheel    [ ] ±1 %
u    undo     s   save
e    excite   ␣   stop
! e-stop F2 arm  Esc quit"""
STEPS = {"left": (-1, COARSE), "right": (1, COARSE), "[": (-1, FINE), "]": (1, FINE)}
ON_THE_GROUND = "Wheels off the ground? 'e' again drives ±{:g} m/s, other keys do not."


class Tune(RobotScreen):
    """Tunes the wheels of one robot; ``unsaved`` says whether gains have changed since the last save."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,ctrl+c,ctrl+q,Q", "leave", priority=True),
        Binding("tab", "next_wheel", priority=True),
    ]
    CSS: ClassVar[str] = (
        RobotScreen.BASE_CSS
        + """
    #plots { width: 1fr; }
    #gains { height: 1fr; }
    #side { width: 28; padding: 0 0 0 1; border-left: solid $primary; height: 1fr; }
    #help { color: $text-muted; dock: bottom; height: 5; }
    """
    )

    def __init__(self, robot: Client, address: str, config: Path | None, wave: Wave) -> None:
        super().__init__(robot, address)
        self._config, self._wave = config, wave
        self._exciter = Exciter(robot, wave, self.say)
        self._trace = Trace(SHOWN_S)
        self._gains: dict[str, PidParameters] = {}
        self._saved: dict[str, PidParameters] = {}
        self._chosen, self._wheel = NAMES[0], ALL_WHEELS
        self._confirming = False

    @property
    def unsaved(self) -> bool:
        """Whether the gains differ from those at the start, or at the last save."""
        return self._gains != self._saved

    def restoring_commands(self) -> list[str]:
        """The commands that set the unsaved gains again."""
        return restore_commands(self._saved, self._gains)

    def compose(self) -> ComposeResult:
        """Textual: title, the plots beside gains and keys, and a line for messages."""
        yield Static(f"{self.heading}: wheel control", id="title")
        with Horizontal():
            with Vertical(id="plots"):
                for panel in PANELS:
                    yield WheelPlot(panel)
            with Vertical(id="side"):
                yield Static(id="gains")
                yield Static(HELP, id="help", markup=False)
        yield Static(id="message", markup=False)

    async def on_mount(self) -> None:
        """Textual: the screen is there, so begin."""
        self.run_tasks(self._exciter.run(), self._read_samples(), self._follow_gains())
        self.draw_at(SHOWN_HZ, self._draw)

    async def on_app_blur(self) -> None:
        """Textual: the terminal lost the focus, so the user may not be looking."""
        self._exciter.end()

    def action_next_wheel(self) -> None:
        """Textual: the next wheel, then all of them again."""
        choices = [ALL_WHEELS, *self._gains]
        self._wheel = choices[(choices.index(self._wheel) + 1) % len(choices)]

    async def on_key(self, event: events.Key) -> None:
        """Textual: a key arrived, or was repeated."""
        key = event.character if event.is_printable and event.character else event.key
        confirmed, self._confirming = self._confirming and key == "e", False
        self.say("")
        if key in STEPS:
            await self._step_gain(*STEPS[key])
        elif key in ("up", "down"):
            self._chosen = NAMES[(NAMES.index(self._chosen) + (1 if key == "down" else -1)) % len(NAMES)]
        elif key == "e":
            self._excite(confirmed)
        else:
            await self._command(key)

    async def _command(self, key: str) -> None:
        """Keys that send a request or save; any other key stops the robot."""
        if key == "u":
            await self.ask(self._undo(), "Undone.")
        elif key == "s":
            await self._save()
        elif key == ARM_KEY:
            await self.ask(arm_seen(self.robot), "Armed.")
        elif key == "!":
            self._exciter.on = False
            await self.ask(self.robot.estop("asked by pid tune"), "Emergency stop; F2 arms again.")
        else:
            self._exciter.stop()

    def _excite(self, confirmed: bool) -> None:
        if self._exciter.on:
            self._exciter.end()
        elif confirmed:
            self._exciter.start()
        else:
            self._confirming = True
            self.say(ON_THE_GROUND.format(self._wave.amplitude_m_s))

    # Gains

    async def _step_gain(self, direction: int, share: float) -> None:
        if self._gains:
            value = step_gain(self._chosen, self._value(), direction, share)
            await self.ask(self._change(value), f"{self._chosen} = {_format_gain(value)} on {self._wheel}")

    async def _change(self, value: Gain) -> None:
        self._take_gains(await self.robot.set_pid(self._wheel, **cast(Gains, {self._chosen: value})))

    async def _undo(self) -> None:
        self._take_gains(await self.robot.undo_pid())

    async def _follow_gains(self) -> None:
        while True:
            await self._read_gains()
            await asyncio.sleep(GAINS_PERIOD_S)

    async def _read_gains(self) -> None:
        self._take_gains(await self.robot.get_pid())
        self._saved = self._saved or self._gains

    def _take_gains(self, wheels: dict[str, PidParameters]) -> None:
        self._gains = wheels

    async def _save(self) -> None:
        if self._config is None:
            self.say("No file to save to: start with --config FILE, or 'chefbotctl pid save FILE' later.")
            return
        if not await self.ask(self._read_gains(), ""):  # another client may have changed them
            return
        gains = self._gains
        try:
            await asyncio.to_thread(save, self._config, gains)
        except (OSError, SettingsError) as error:
            self.say(f"not saved: {error}")
        else:
            self._saved = gains
            self.say(f"Saved to {self._config}.")

    def _value(self) -> Gain:
        wheel = next(iter(self._gains)) if self._wheel == ALL_WHEELS else self._wheel
        value: Gain = getattr(self._gains[wheel], self._chosen)
        return value

    # What is shown

    async def _read_samples(self) -> None:
        async with self.robot.subscribe("wheels", policy="ordered") as samples:
            async for sample in samples:
                self._trace.add(sample.stamp_s, plain(sample.data))

    def _draw(self) -> None:
        wheels = [self._wheel] if self._wheel != ALL_WHEELS else list(self._trace.wheels)
        traces = [self._trace.of(wheel) for wheel in wheels]
        for plot in self.query(WheelPlot):
            if plot.is_mounted:
                plot.show(traces)
        self.query_one("#gains", Static).update(self._side(), layout=False)

    def _side(self) -> Table:
        """Gains, and the error of each wheel (its root mean square in rad/s) in the wheel's colour."""
        side = Table.grid(padding=(0, 1))
        excited = " excited" if self._exciter.on else ""
        side.add_row(Text("wheel"), Text(self._wheel + excited, style=Style.NOTICE))
        for name in NAMES if self._gains else ():
            style = "reverse" if name == self._chosen else Style.PLAIN
            side.add_row(Text(SHORT.get(name, name), style=style), Text(self._gain_text(name), style=style))
        for wheel, colour in assign_colours(self._trace.wheels):
            rms = f"{self._trace.of(wheel).rms_error_rad_s():.3f} rms"
            side.add_row(Text(wheel.removesuffix("_wheel"), style=colour), Text(rms))
        return side

    def _gain_text(self, name: str) -> str:
        """A gain of the chosen wheel; for all wheels the first one's, marked where they differ."""
        wheels = self._gains if self._wheel == ALL_WHEELS else [self._wheel]
        values = [getattr(self._gains[wheel], name) for wheel in wheels]
        return _format_gain(values[0]) + ("" if values.count(values[0]) == len(values) else " (differ)")


SHORT = {
    "integral_limit": "i limit",
    "output_limit": "limit",
    "derivative_filter_s": "d filter",
    "back_calculation_s": "back calc",
    "conditional_integration": "cond int",
}
"""Short labels for names that do not fit beside their values."""


def _format_gain(value: Gain) -> str:
    if value is None:
        return "off"
    return ("on" if value else "off") if isinstance(value, bool) else f"{value:g}"


async def tune(
    robot: Client,
    address: str,
    config: Path | None,
    wave: Wave,
    tell_unsaved: Callable[[list[str]], None],
) -> None:
    """Tune until the user quits; raises the client's errors.

    At the end ``tell_unsaved`` gets the commands that set unsaved gains again, also after an error.
    """
    screen = Tune(robot, address, config, wave)
    try:
        await screen.show()
    finally:
        if screen.unsaved:
            tell_unsaved(screen.restoring_commands())
