"""Driving by gamepad: the pad is looked at a hundred times a second, and what it asks for goes to the robot.

Who lets go gives the robot back: the pad's own target is zero at once, and lower sources go on.
"""

import asyncio
from collections.abc import Callable
from typing import Protocol

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.gamepad import UNTOUCHED, Demand, Order, PadParameters, Reading, disabled, step
from chefbotd.cli.drive.pilot import let_go, told_of_stop
from chefbotd.client import CallError, Client

LOOK_PERIOD_S = 0.01
OWN_SOURCE = "joystick"
NO_PAD = "no gamepad found: is one plugged in, and may you read /dev/input/event* (group 'input')?"


class Device(Protocol):
    """A gamepad."""

    name: str

    def read(self) -> Reading | None:
        """It as it is now; None while it is not there."""
        ...


class JoystickPilot:
    """Drives a robot by a pad; ``say`` is told of what the driver should know.

    Without a source it speaks as ``joystick`` where the robot has that, and else as the robot's default source. With
    ``takes_over`` it takes control of that source from whoever has it.
    """

    def __init__(
        self,
        robot: Client,
        device: Device,
        say: Callable[[str], None],
        parameters: PadParameters,
        source: str | None = None,
        *,
        takes_over: bool = False,
    ) -> None:
        self._takes_over = takes_over
        self._robot, self._device, self._say = robot, device, say
        self._parameters, self._fallback = parameters, source is None
        self._source: str | None = source or OWN_SOURCE
        self._pad, self._there = UNTOUCHED, True

    async def run(self) -> None:
        """Drive until cancelled; lets go on every way out on which the robot may be moving.

        Raises:
            ProgramError: there is no pad to begin with.
            ChefbotError: the client's, but for refusals, which are told.
        """
        if self._device.read() is None:
            raise ProgramError(Exit.FAILED, NO_PAD)
        if self._takes_over:
            await self._take_control()
        try:
            while True:
                await self._look()
                await asyncio.sleep(LOOK_PERIOD_S)
        finally:
            if self._pad.enabled and self._robot.connected:
                await let_go(self._robot, self._source)

    async def _take_control(self) -> None:
        try:
            await self._robot.take_control(self._source)
        except CallError as error:
            if not self._falls_back(error):
                raise
            await self._robot.take_control(self._source)

    def _falls_back(self, error: CallError) -> bool:
        """Whether from now on the default source speaks, since there is none of our own name."""
        if not self._fallback or error.kind != "unknown_source":
            return False
        self._source, self._fallback = None, False
        return True

    async def _look(self) -> None:
        reading = self._device.read()
        if self._there != (reading is not None):
            self._there = reading is not None
            self._say(f"{self._device.name} is {'back' if self._there else 'gone: it drives no more'}")
        self._pad, orders = step(self._parameters, self._pad, reading, asyncio.get_running_loop().time())
        for order in orders:
            await self._obey(order)

    async def _obey(self, order: Order) -> None:
        try:
            await self._ask(order)
        except CallError as error:
            if self._falls_back(error):
                await self._obey(order)
                return
            self._pad = disabled(self._pad)
            self._say(f"{error.kind}: {error.message}")

    async def _ask(self, order: Order) -> None:
        if order is Demand.LET_GO:
            await let_go(self._robot, self._source)
        elif order is Demand.STOP:
            self._say(told_of_stop(await self._robot.stop()))
        elif order is Demand.ESTOP:
            await self._robot.estop("asked by joystick")
            self._say("Emergency stop; Start arms again.")
        elif order is Demand.ARM:
            await self._robot.arm()
            self._say("Armed.")
        else:
            await self._robot.drive(order.linear_m_s, order.angular_rad_s, self._source)
