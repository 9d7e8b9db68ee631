"""Checks whether the board stops by itself: our own firmware does; of another it is not known."""

from chefbotd.components.doctor.algorithms.finding import Finding, Verdict, ok, skip_check, warning
from chefbotd.core.record import Record

CHECK = "firmware"
CLASSIC = (
    "not chefbotd's own: it is not known to stop by itself when the cable is pulled or the daemon is killed"
)
FLASH = "'chefbotctl flash' puts the firmware that does on it"


class FirmwareFacts(Record, frozen=True):
    """What our firmware says of itself; ``deadman_ms`` None where it does not stop by itself now."""

    version: str
    board: str
    deadman_ms: int | None
    reset_cause: str = ""
    crc_errors: int = 0
    refused: int = 0
    overruns: int = 0
    deadman_stops: int = 0
    round_trip_s: float | None = None
    reason: str = ""


def check_firmware(firmware: FirmwareFacts | None, *, is_board: bool) -> Finding:
    """Which firmware it is, and its dead-man; ``firmware`` None: none of ours has named itself."""
    if not is_board:
        return skip_check(CHECK, "nothing was received from a board")
    if firmware is None:
        return Finding(CHECK, Verdict.OK, CLASSIC, FLASH)
    name = f"chefbot firmware {firmware.version} on {firmware.board or 'an unknown board'}"
    if firmware.deadman_ms is None:
        reason = firmware.reason or "nobody has agreed on the checked mode with it"
        return warning(
            CHECK,
            f"{name}, which does not stop by itself now: {reason}",
            "run the daemon with [link] firmware = 'auto', and look at the cable if it does so already",
        )
    if firmware.overruns:
        return warning(
            CHECK,
            f"{name} has lost {firmware.overruns} bytes of what it was sent",
            "is the baud rate right, and does nobody else write to the port?",
        )
    return ok(CHECK, f"{name}; {_figures(firmware)}")


def _figures(firmware: FirmwareFacts) -> str:
    trip = "" if firmware.round_trip_s is None else f", round trip {1000 * firmware.round_trip_s:.1f} ms"
    return (
        f"it stops {firmware.deadman_ms} ms after the last command; last start by {firmware.reset_cause}, "
        f"{firmware.crc_errors} lines damaged, {firmware.refused} refused, "
        f"{firmware.deadman_stops} stops by its dead-man{trip}"
    )
