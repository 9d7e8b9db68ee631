"""The parameters in which the published sketches differ: a row each, for the one program in ``simulation/sketch.py``.

The four published sketches were measured unchanged, built for a computer and driven through a pty. What is not known
of them is marked "assumed". No sketch of KHAN's is published: all of its row is assumed.
"""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from pydantic import Field, model_validator

from chefbotd.core.parameters import Parameters


class PwmLaw(StrEnum):
    """How ``analogWrite`` treats a value that its range does not hold."""

    CLIPPED = "clipped"
    """Energia on the Tiva: full scale and more is full on."""

    LOW_BYTE = "low_byte"
    """An AVR: only the low eight bits count, so 256 is off and 400 is 144."""


UINT32_SPAN = 1 << 32
LINE_KINDS = "teusiab"


class SketchName(StrEnum):
    """The published sketches of ChefBot, what KHAN's board is assumed to run, and our own firmware.

    ``chefbot`` is our firmware's core, compiled for this computer, ``emulated`` its image in an emulator.
    """

    TIVA = "tiva"
    TIVA_BARE = "tiva_bare"
    DUEMILANOVE = "duemilanove"
    TIVA_SECOND = "tiva_second"
    KHAN = "khan"
    CHEFBOT = "chefbot"
    EMULATED = "emulated"


OWN_FIRMWARE = (SketchName.CHEFBOT, SketchName.EMULATED)
OTHERS = (SketchName.KHAN, *OWN_FIRMWARE)
PUBLISHED_SKETCHES = tuple(name for name in SketchName if name not in OTHERS)
CHEFBOT_SKETCHES = (*PUBLISHED_SKETCHES, SketchName.CHEFBOT)
"""What ChefBot's board may run: a published sketch, or our own firmware."""


class SketchParameters(Parameters):
    """A sketch, and the serial port below it.

    ``lines`` are the kinds of lines of a cycle in their order; a line about something that is not wired is left out. A
    cycle takes at least ``cycle_s``. A sketch that ``waits_for_imu`` waits for a sample of the motion processor, which
    takes one every ``cycle_s``; if the sketch is late, samples queue, and it reads the oldest. ``missing_imu_share``
    of the cycles find no sample. ``resets``: ``r`` restarts the board, and is not only answered. The USB converter
    hands over at once what came within ``handover_s``. ``cuts_first_line``: a host that opens the port first reads the
    end of a line.
    """

    lines: str = Field("teusib", pattern=f"^[{LINE_KINDS}]+$")
    """The kinds of lines of a cycle, in their order."""
    cycle_s: float = Field(0.05, gt=0, le=10)
    """A cycle takes at least so long."""
    waits_for_imu: bool = False
    """The sketch waits for a sample of the motion processor in each cycle."""
    missing_imu_share: float = Field(0.0, ge=0, le=1)
    """The share of cycles that find no sample."""
    has_banner: bool = True
    """It greets when it starts."""
    cuts_first_line: bool = True
    """A host that opens the port first reads the end of a line."""
    resets: bool = True
    """The line ``r`` restarts the board, and is not only answered."""
    receive_buffer_bytes: int = Field(1024, ge=1)
    """What the board keeps of bytes that it has not read yet."""
    transmit_buffer_bytes: int = Field(64, ge=1)
    """What it keeps of bytes that the line has not taken yet; then it waits."""
    handover_s: float = Field(0.0, ge=0, le=1)
    """The USB converter hands over at once what came within this time."""
    pwm_full_scale: int = Field(255, ge=1, le=65_535)
    """The duty at which the bridge is fully on."""
    pwm_law: PwmLaw = PwmLaw.CLIPPED
    """What becomes of a duty beyond that: ``clipped`` is full on, with ``low_byte`` only the low eight bits
    count."""


SKETCHES: Mapping[SketchName, SketchParameters] = MappingProxyType(
    {
        SketchName.TIVA: SketchParameters(cycle_s=0.05, waits_for_imu=True, missing_imu_share=0.19),
        SketchName.TIVA_BARE: SketchParameters(lines="esb", cycle_s=1 / 290, has_banner=False),
        SketchName.DUEMILANOVE: SketchParameters(
            lines="teusi",
            cycle_s=0.02,
            resets=False,
            receive_buffer_bytes=63,
            transmit_buffer_bytes=63,
            handover_s=0.016,
            pwm_law=PwmLaw.LOW_BYTE,
        ),
        SketchName.TIVA_SECOND: SketchParameters(lines="tesb", cycle_s=0.005, has_banner=False),
        SketchName.KHAN: SketchParameters(
            lines=LINE_KINDS, cycle_s=0.02, cuts_first_line=False, pwm_full_scale=1023
        ),
        SketchName.CHEFBOT: SketchParameters(
            cycle_s=0.01,
            receive_buffer_bytes=128,
            transmit_buffer_bytes=255,
        ),
        SketchName.EMULATED: SketchParameters(cycle_s=0.01),
    }
)
"""The buffers of the Tiva's are assumed, and all of KHAN's: a program of the same kind at its 50 Hz.

Of our own firmware's row only the receive buffer and the duties count; all else is its own.
"""


class BoardParameters(SketchParameters):
    """The board. Values that are not given are those of its ``sketch``, which is the published Tiva's unless told.

    Where it decodes no encoders, it keeps ``edge_buffer`` edges of each wheel from one cycle to the next. Its line is as
    fast as the robot's, unless ``line_rate_bytes_s`` says another. Its analogue inputs have ``adc_bits``.
    """

    sketch: SketchName = SketchName.TIVA
    """What the board runs; what is not given here is that sketch's."""
    line_rate_bytes_s: float | None = Field(None, gt=0)
    """How fast its line is; left out, as fast as the robot's."""
    echo_timeout_s: float = Field(1.0, ge=0, le=1)
    """For so long the sketch waits for an ultrasonic echo that does not come."""
    blocking_ultrasonic: bool = True
    """The sketch does nothing else while it waits for an echo."""
    raw_imu: bool = False
    """It sends raw readings of the IMU instead of an orientation."""
    adc_bits: int = Field(12, ge=8, le=16)
    """The resolution of its analogue inputs."""
    edge_buffer: int = Field(512, ge=1)
    boot_s: float = Field(0.2, ge=0, le=60)
    """The time from its start to its first line."""
    reset_delay_s: float = Field(1.0, ge=0, le=60)
    """The time from ``r`` to its restart."""
    boot_micros: int = Field(0, ge=0, lt=UINT32_SPAN)
    """Where its clock of microseconds starts, which wraps round after 71 minutes."""

    @model_validator(mode="before")
    @classmethod
    def _as_the_sketch(cls, given: Any) -> Any:
        """What is not given is as the sketch has it; a name that is none is left to be refused."""
        if not isinstance(given, Mapping):
            return given
        name = given.get("sketch", SketchName.TIVA)
        if name not in list(SketchName):
            return dict(given)
        return {**SKETCHES[SketchName(name)].model_dump(), **given}
