"""Analogue inputs that all read a share of what they should: the board's ADC has other bits than are configured."""

from collections.abc import Mapping, Sequence

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, warning
from chefbotd.core.record import Record

USUAL_BITS = (8, 10, 12, 14, 16)
"""An ATmega's 10, a Tiva's, an STM32's and an ESP32's 12, an external ADC's 16."""

SILENT_V = 0.2
"""A Sharp GP2Y0A02YK gives no less where it sees nothing (0.4 V at 1.5 m by its data sheet; assumed beyond)."""

BAND = 0.9, 1.1
"""A battery is between this share of its critical voltage and of its full one."""


class AnalogueInput(Record, frozen=True):
    """An infrared sensor's input: its highest reading (None: it told nothing), its bits and what a full reading is."""

    sensor: str
    highest: float | None
    adc_bits: int
    reference_v: float


def check_adc(
    battery: float | None,
    full_scale: int,
    volts_per_count: float,
    battery_band_v: tuple[float, float],
    inputs: Sequence[AnalogueInput],
) -> Finding | None:
    """Whether the readings fit the configured bits; None where no analogue input was heard.

    ``battery`` is the highest reading of the battery's input, of which ``full_scale`` is the highest possible and
    ``volts_per_count`` the volts of the battery; a healthy one is within ``battery_band_v`` (critical, full).
    """
    heard = {sensor_input.sensor: sensor_input for sensor_input in inputs if sensor_input.highest is not None}
    if battery is None and not heard:
        return None
    beyond = {
        name: sensor_input
        for name, sensor_input in heard.items()
        if (sensor_input.highest or 0) >= 1 << sensor_input.adc_bits
    }
    if beyond or (battery or 0) > full_scale:
        return _beyond(battery, full_scale, beyond)
    low = {name: sensor_input for name, sensor_input in heard.items() if _volts(sensor_input) < SILENT_V}
    bits = _bits_of_battery(battery, full_scale, volts_per_count, battery_band_v)
    if bits is not None and battery is not None:
        others = f", and {', '.join(low)} at most {max(map(_volts, low.values())):.2f} V" if low else ""
        return problem(
            "adc",
            f"the battery's input says {battery * volts_per_count:.2f} V{others}: with an ADC of {bits} bits that is "
            f"{battery * volts_per_count * (full_scale + 1) / (1 << bits):.1f} V",
            f"set [battery] adc_full_scale = {(1 << bits) - 1} and adc_bits = {bits} in each [[infrared]]; if the ADC "
            f"has {(full_scale + 1).bit_length() - 1} bits, the divider is another one or not wired",
        )
    if low:
        volts = ", ".join(
            f"{name} at most {_volts(sensor_input):.2f} V" for name, sensor_input in low.items()
        )
        return warning(
            "adc",
            f"{volts}, less than such a sensor gives where it sees nothing",
            "it is unplugged, or the board's ADC has fewer bits than adc_bits in [[infrared]] says: a 10-bit one reads "
            "a quarter of a 12-bit one, and a wall is not seen before it is hit",
        )
    return ok("adc", "the analogue readings fit the configured bits")


def _volts(sensor_input: AnalogueInput) -> float:
    return (sensor_input.highest or 0.0) * sensor_input.reference_v / ((1 << sensor_input.adc_bits) - 1)


def _bits_of_battery(
    battery: float | None, full_scale: int, volts_per_count: float, band_v: tuple[float, float]
) -> int | None:
    """The bits with which the battery would be a healthy one; None: it is one, or it is none with any bits."""
    if battery is None or _is_within(battery * volts_per_count, band_v):
        return None
    for bits in USUAL_BITS:
        if _is_within(battery * volts_per_count * (full_scale + 1) / (1 << bits), band_v):
            return bits
    return None


def _is_within(voltage_v: float, band_v: tuple[float, float]) -> bool:
    return band_v[0] * BAND[0] <= voltage_v <= band_v[1] * BAND[1]


def _beyond(battery: float | None, full_scale: int, beyond: Mapping[str, AnalogueInput]) -> Finding:
    """Readings that the configured bits cannot give."""
    readings = [
        f"{name} says {sensor_input.highest:g} of {(1 << sensor_input.adc_bits) - 1}"
        for name, sensor_input in beyond.items()
    ]
    if battery is not None and battery > full_scale:
        readings.append(f"the battery's input says {battery:g} of {full_scale}")
    highest = max([sensor_input.highest or 0.0 for sensor_input in beyond.values()] + [battery or 0.0])
    bits = next((bits for bits in USUAL_BITS if highest < 1 << bits), USUAL_BITS[-1])
    return problem(
        "adc",
        f"{', '.join(readings)}: the board's ADC has more bits than the configuration says",
        f"set adc_bits = {bits} in [[infrared]], and [battery] adc_full_scale = {(1 << bits) - 1}",
    )
