"""Checks whether the received bytes are from the configured lidar, and whether it turns."""

from enum import StrEnum

from msgspec import field

from chefbotd.core.record import MutableState, Record
from chefbotd.core.sentence import Sentence
from chefbotd.link.health import show
from firmware_protocol.lidar import ld19, rplidar

JUDGED_AFTER_S = 2.0
"""Time from power-on to a lidar's first turn (assumed)."""

SOON_S, SOON_TURNS = 0.5, 2
"""So many whole turns are heard in little more."""

QUIET_S = 1.0
"""A lidar that sends nothing for this long is silent."""

LEAST_TURNS_PER_S = 1.0
"""A lidar that turns has more whole turns; the slowest of the known ones makes two (assumed)."""

TEXT_SHARE = 0.9
RATES = "LD06, LD19: 230400; RPLIDAR A1, A2M8: 115200; A2M7, A2M12, A3, S1: 256000; C1: 460800"
"""The models' own rates, by their makers' manuals and drivers."""


class LidarCondition(StrEnum):
    """What an open port turned out to be."""

    HEALTHY = "healthy"
    SILENT = "silent"
    WRONG_BAUD = "wrong_baud"
    WRONG_DEVICE = "wrong_device"
    MOTOR_STALLED = "motor_stalled"
    FROZEN = "frozen"
    DEVICE_ERROR = "device_error"


class LidarTotals(Record, frozen=True):
    """Totals: bytes, packets in good form, whole turns, and turns and packets that were there before.

    ``last_s`` is when the last byte came. ``awaits_scan``: the device answers, and has sent nothing of the scan yet.
    """

    bytes: int = 0
    packets: int = 0
    turns: int = 0
    repeated: int = 0
    last_s: float = 0.0
    awaits_scan: bool = False

    def since(self, before: "LidarTotals") -> "LidarTotals":
        """What was heard after ``before``."""
        return LidarTotals(
            self.bytes - before.bytes,
            self.packets - before.packets,
            self.turns - before.turns,
            self.repeated - before.repeated,
            self.last_s,
            self.awaits_scan,
        )


class LidarHealth(Record, frozen=True):
    """The condition, and for people what was heard and what it suggests (empty while healthy)."""

    condition: LidarCondition
    reason: str


class LidarHealthWatch(MutableState):
    """Judges one connection from ``from_s`` on; look at it a few times a second."""

    from_s: float
    before: LidarTotals
    _reported: LidarHealth | None = field(default=None, name="_told")

    def look(self, now_s: float, heard: LidarTotals, sample: bytes, complaint: str) -> LidarHealth | None:
        """The health if it has changed; ``sample`` are the newest bytes, ``complaint`` what the lidar says is wrong."""
        new, waited_s = heard.since(self.before), now_s - self.from_s
        soon = waited_s >= SOON_S and new.turns >= max(SOON_TURNS, LEAST_TURNS_PER_S * waited_s)
        if not soon and waited_s < JUDGED_AFTER_S:
            return None
        self.from_s, self.before = now_s, heard
        quiet_s = waited_s if not new.bytes else now_s - new.last_s
        health = judge(new, quiet_s, sample, complaint, waited_s)
        if self._reported is not None and health.condition is self._reported.condition:
            return None
        self._reported = health
        return health


def judge(
    new: LidarTotals, quiet_s: float, sample: bytes, complaint: str, waited_s: float = 0.0
) -> LidarHealth:
    """What has been heard in ``waited_s`` says of the port; ``quiet_s`` is how long there has been nothing now.

    One good turn among many that are missing, or old, does not make it healthy.
    """
    if new.awaits_scan and not complaint:
        return LidarHealth(
            LidarCondition.MOTOR_STALLED,
            Sentence("lidar.no_scan", "it answers, but sends no scan: does its motor turn?"),
        )
    if quiet_s >= QUIET_S and not new.turns:
        reason = Sentence(
            "lidar.silent",
            "nothing received for {seconds:.1f} s: does the lidar have power, is this its port, and its baud "
            "rate? ({rates})",
            seconds=quiet_s,
            rates=RATES,
        )
        return LidarHealth(LidarCondition.SILENT, reason)
    received = Sentence(
        "lidar.received",
        "{bytes} bytes, {packets} packets; received: {sample}",
        bytes=new.bytes,
        packets=new.packets,
        sample=show(sample),
    )
    if not new.packets:
        return _judge_foreign(sample, received)
    if complaint:
        wrong = LidarCondition.WRONG_DEVICE if "another lidar" in complaint else LidarCondition.DEVICE_ERROR
        return LidarHealth(wrong, complaint)
    if new.turns and new.turns >= LEAST_TURNS_PER_S * waited_s:
        return LidarHealth(LidarCondition.HEALTHY, "")
    if new.repeated:
        reason = Sentence(
            "lidar.frozen",
            "the same data again ({times} times): the lidar has frozen, or its bytes are replayed",
            times=new.repeated,
        )
        return LidarHealth(LidarCondition.FROZEN, reason)
    if new.turns:
        stalled = Sentence(
            "lidar.few_turns",
            "packets but only {turns} whole turns in {seconds:.1f} s: does its motor turn? {received}",
            turns=new.turns,
            seconds=waited_s,
            received=received,
        )
    else:
        stalled = Sentence(
            "lidar.no_turn", "packets but no whole turn: does its motor turn? {received}", received=received
        )
    return LidarHealth(LidarCondition.MOTOR_STALLED, stalled)


def _judge_foreign(sample: bytes, received: str) -> LidarHealth:
    """Bytes that are no packet of the configured lidar: another lidar's, a board's text, or a wrong baud rate."""
    decoder = ld19.Ld19Decoder()
    if decoder.feed_bytes(sample):
        return LidarHealth(
            LidarCondition.WRONG_DEVICE,
            Sentence(
                "lidar.other_ld",
                "these are packets of an LD06 or LD19: is the model right? {received}",
                received=received,
            ),
        )
    if rplidar.DESCRIPTOR_START in sample:
        return LidarHealth(
            LidarCondition.WRONG_DEVICE,
            Sentence(
                "lidar.other_rplidar",
                "this may be an RPLIDAR: is the model right? {received}",
                received=received,
            ),
        )
    text = sum(0x20 <= byte <= 0x7E or byte in b"\t\r\n" for byte in sample)
    if text >= TEXT_SHARE * len(sample):
        return LidarHealth(
            LidarCondition.WRONG_DEVICE,
            Sentence(
                "lidar.text", "this is text: is this the port of the board? {received}", received=received
            ),
        )
    return LidarHealth(
        LidarCondition.WRONG_BAUD,
        Sentence(
            "lidar.wrong_baud",
            "no packets: is the baud rate right ({rates}), and is this the lidar's port? {received}",
            rates=RATES,
            received=received,
        ),
    )
