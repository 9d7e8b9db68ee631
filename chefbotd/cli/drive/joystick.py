"""Drives by gamepad: polls the pad 100 times a second, and sends its commands to the robot.

Releasing the enable button sets the pad's own target to zero at once and releases its source; lower sources go on.
"""

import asyncio
from collections.abc import Callable
from typing import Protocol

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.control import arm_seen, describe_stop, release_source
from chefbotd.cli.drive.gamepad import (
    INITIAL_PAD,
    Order,
    PadReading,
    PadRequest,
    StickScale,
    disable_pad,
    step,
)
from chefbotd.client import CallError, Client, MotionInterrupted

POLL_PERIOD_S = 0.01
OWN_SOURCE = "joystick"
NO_PAD = "no gamepad found: is one plugged in, and may you read /dev/input/event* (group 'input')?"


class Gamepad(Protocol):
    """A gamepad."""

    name: str

    def read(self) -> PadReading | None:
        """The present reading; None while the pad is not connected."""
        ...


class JoystickPilot:
    """Drives a robot by a pad; ``say`` shows a message to the driver.

    Without ``source`` it commands as the source ``joystick`` if the robot has one, and else as the default source. With
    ``takes_over`` it takes control of that source from the client that has it.
    """

    def __init__(
        self,
        robot: Client,
        device: Gamepad,
        say: Callable[[str], None],
        scale: StickScale,
        source: str | None = None,
        *,
        takes_over: bool = False,
    ) -> None:
        self._takes_over = takes_over
        self._robot, self._device, self._say = robot, device, say
        self._scale, self._fallback = scale, source is None
        self._source: str | None = source or OWN_SOURCE
        self._pad, self._pad_connected = INITIAL_PAD, True

    async def run(self) -> None:
        """Drive until cancelled. If the robot may be moving, release the source at the end, also after an error.

        Raises:
            ProgramError: no pad is connected at the start.
            ChefbotError: a client error other than a refusal; refusals are shown.
        """
        if self._device.read() is None:
            raise ProgramError(Exit.FAILED, NO_PAD)
        if self._takes_over:
            await self._take_control()
        try:
            while True:
                await self._poll()
                await asyncio.sleep(POLL_PERIOD_S)
        finally:
            if self._pad.enabled and self._robot.connected:
                await release_source(self._robot, self._source)

    async def _take_control(self) -> None:
        try:
            await self._robot.take_control(self._source)
        except CallError as error:
            if not self._falls_back(error):
                raise
            await self._robot.take_control(self._source)

    def _falls_back(self, error: CallError) -> bool:
        """Switch to the default source if the robot has no source ``joystick``; whether that was done."""
        if not self._fallback or error.kind != "unknown_source":
            return False
        self._source, self._fallback = None, False
        return True

    async def _poll(self) -> None:
        reading = self._device.read()
        if self._pad_connected != (reading is not None):
            self._pad_connected = reading is not None
            self._say(
                f"{self._device.name} is {'back' if self._pad_connected else 'gone: it drives no more'}"
            )
        self._pad, orders = step(self._scale, self._pad, reading, asyncio.get_running_loop().time())
        for order in orders:
            await self._obey(order)

    async def _obey(self, order: Order) -> None:
        try:
            await self._send_order(order)
        except CallError as error:
            if self._falls_back(error):
                await self._obey(order)
                return
            self._pad = disable_pad(self._pad)
            self._say(f"{error.kind}: {error.message}")
        except MotionInterrupted as error:
            self._pad = disable_pad(self._pad)
            self._say(str(error))

    async def _send_order(self, order: Order) -> None:
        if order is PadRequest.RELEASE:
            await release_source(self._robot, self._source)
        elif order is PadRequest.STOP:
            self._say(describe_stop(await self._robot.stop()))
        elif order is PadRequest.ESTOP:
            await self._robot.estop("asked by joystick")
            self._say("Emergency stop; Start arms again.")
        elif order is PadRequest.ARM:
            await arm_seen(self._robot)
            self._say("Armed.")
        else:
            await self._robot.drive(order.linear_m_s, order.angular_rad_s, self._source)
