"""Real SDL with a virtual gamepad."""

from collections.abc import Iterator
from typing import Any

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.gamepad import Button, PadReading
from chefbotd.cli.drive.sdl_gamepad import SdlPad, sdl2
from tests.chefbotd.conftest import Control


class VirtualPad:
    """A gamepad that SDL takes for a real one."""

    def __init__(self) -> None:
        self._index = sdl2.SDL_JoystickAttachVirtual(sdl2.SDL_JOYSTICK_TYPE_GAMECONTROLLER, 6, 15, 0)
        self._stick: Any = sdl2.SDL_JoystickOpen(self._index)

    def set(self, left_x: float, left_y: float, *buttons: int) -> None:
        """Stick and buttons, in SDL's own signs."""
        for axis, value in ((0, left_x), (1, left_y)):
            sdl2.SDL_JoystickSetVirtualAxis(self._stick, axis, int(value * 32767))
        for button in range(15):
            sdl2.SDL_JoystickSetVirtualButton(self._stick, button, int(button in buttons))

    def unplug(self) -> None:
        """Take it away."""
        sdl2.SDL_JoystickClose(self._stick)
        sdl2.SDL_JoystickDetachVirtual(self._index)


@pytest.fixture
def pad() -> Iterator[SdlPad]:
    """SDL, running, on a computer without gamepads."""
    with SdlPad() as started:
        if sdl2.SDL_NumJoysticks() > 0:
            pytest.skip("a real gamepad is plugged in")
        yield started


def test_without_a_pad(pad: SdlPad) -> None:
    """There is nothing to read."""
    assert pad.read() is None


def test_a_pad_is_read(pad: SdlPad) -> None:
    """Away from the driver is forward, left is left, and the buttons are where they are printed."""
    virtual = VirtualPad()
    assert pad.read() == PadReading()
    assert pad.name == "Virtual Controller"
    virtual.set(-1.0, -0.5, sdl2.SDL_CONTROLLER_BUTTON_LEFTSHOULDER, sdl2.SDL_CONTROLLER_BUTTON_B)
    reading = pad.read()
    assert reading is not None
    assert (reading.forward, reading.left) == pytest.approx((0.5, 1.0), abs=1e-3)
    assert reading.down == {Button.ENABLE, Button.ESTOP}
    virtual.set(0.0, 0.0, sdl2.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER, sdl2.SDL_CONTROLLER_BUTTON_START)
    assert pad.read() == PadReading(down=frozenset({Button.TURBO, Button.ARM}))
    virtual.set(0.0, 0.0, sdl2.SDL_CONTROLLER_BUTTON_X)
    assert pad.read() == PadReading(down=frozenset({Button.STOP}))
    virtual.unplug()


def test_a_pad_comes_and_goes(pad: SdlPad) -> None:
    """An unplugged pad reads as none, the next one is found."""
    for _ in range(2):
        virtual = VirtualPad()
        assert pad.read() == PadReading()
        virtual.unplug()
        assert pad.read() is None


def test_sdl_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends the program with SDL's own words."""
    monkeypatch.setattr(sdl2, "SDL_Init", lambda _flags: -1)
    with pytest.raises(ProgramError, match="SDL does not start"), SdlPad():
        pytest.fail("unreachable")


def test_the_command_without_a_pad(control: Control, pad: SdlPad) -> None:
    """It says how it would be driven, and that there is no pad."""
    result = control("joystick")
    assert result.exit_code == Exit.FAILED
    assert "Hold LB" in result.stderr
    assert "no gamepad found" in result.stderr
