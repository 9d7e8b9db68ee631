"""Gamepads through SDL, which knows the layout of each model; needs the extra ``joystick``."""

import warnings
from types import TracebackType
from typing import Any, Self

with warnings.catch_warnings():
    warnings.simplefilter("ignore", UserWarning)  # PySDL2 warns that it uses the library that came with it
    import sdl2

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.gamepad import Button, PadReading

BUTTONS = {
    Button.ENABLE: sdl2.SDL_CONTROLLER_BUTTON_LEFTSHOULDER,
    Button.TURBO: sdl2.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER,
    Button.STOP: sdl2.SDL_CONTROLLER_BUTTON_X,
    Button.ESTOP: sdl2.SDL_CONTROLLER_BUTTON_B,
    Button.ARM: sdl2.SDL_CONTROLLER_BUTTON_START,
}
HELP = """\
Hold LB and move the left stick to drive; RB is turbo. Releasing LB ends your own motion; another
driver may go on. X stops the robot, whoever drives; B is the emergency stop; Start arms."""
FULL = 32768


class SdlPad:
    """The first gamepad that is connected, now or later; use it as a context manager."""

    def __init__(self) -> None:
        self._pad: Any = None
        self.name = ""

    def __enter__(self) -> Self:
        """Start SDL; raises ``ProgramError`` when it cannot."""
        sdl2.SDL_SetHint(sdl2.SDL_HINT_NO_SIGNAL_HANDLERS, b"1")
        sdl2.SDL_SetHint(sdl2.SDL_HINT_JOYSTICK_ALLOW_BACKGROUND_EVENTS, b"1")  # we have no window
        if sdl2.SDL_Init(sdl2.SDL_INIT_GAMECONTROLLER) != 0:
            raise ProgramError(Exit.FAILED, f"SDL does not start: {sdl2.SDL_GetError().decode()}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()
        sdl2.SDL_Quit()

    def read(self) -> PadReading | None:
        """The pad as it is now; None while there is none. Does not wait."""
        sdl2.SDL_GameControllerUpdate()
        if self._pad is not None and not sdl2.SDL_GameControllerGetAttached(self._pad):
            self._close()
        if self._pad is None and not self._find():
            return None
        down = [b for b, code in BUTTONS.items() if sdl2.SDL_GameControllerGetButton(self._pad, code)]
        return PadReading(
            forward=-self._axis(sdl2.SDL_CONTROLLER_AXIS_LEFTY),
            left=-self._axis(sdl2.SDL_CONTROLLER_AXIS_LEFTX),
            down=frozenset(down),
        )

    def _axis(self, axis: int) -> float:
        """SDL counts right and towards the driver as positive."""
        return float(sdl2.SDL_GameControllerGetAxis(self._pad, axis)) / FULL

    def _find(self) -> bool:
        for index in range(sdl2.SDL_NumJoysticks()):
            if sdl2.SDL_IsGameController(index) and (pad := sdl2.SDL_GameControllerOpen(index)):
                self._pad, self.name = pad, sdl2.SDL_GameControllerName(pad).decode()
                return True
        return False

    def _close(self) -> None:
        if self._pad is not None:
            sdl2.SDL_GameControllerClose(self._pad)
            self._pad = None
