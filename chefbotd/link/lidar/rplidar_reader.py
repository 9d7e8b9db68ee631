"""Reads RPLIDAR A1 and A2: asks for model and health, starts the scan, and reads whole turns.

Source: Slamtec's "RPLIDAR Interface Protocol and Application Notes". The device has no clock of its own that it tells.
"""

import math
from collections import Counter
from enum import StrEnum
from statistics import median

import numpy as np
from msgspec import field

from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.link.lidar.turn import LEAST_COVERED, LidarTurn
from chefbotd.sensing.lidar import LidarModel
from firmware_protocol.lidar.rplidar import (
    FULL_TURN_Q6,
    POINTS,
    Answer,
    Capsule,
    DeviceHealth,
    DeviceInfo,
    HealthStatus,
    RequestCode,
    RplidarDecoder,
    RplidarDecoderState,
    ScanNode,
    express_request,
    motor_request,
    request,
)

EXPRESS_SINCE = (1, 17)
"""The firmware that first offers the express scan."""

MOTOR_PWM = 660
"""What the maker's driver gives an A2's motor; the A1's is switched by DTR alone."""

SERIES = {LidarModel.RPLIDAR_A1: 0x1, LidarModel.RPLIDAR_A2: 0x2}
"""The upper half of the model number that a device tells."""

LONGEST_TURN_S = 1.0
LEAST_NODES = 30

STEADY_TURNS, STEADY_AFTER = 5, 3
UNSTEADY_SHARE = 0.2
"""A motor's rate changes by less than this from turn to turn; a larger change means that the host read late."""


class ScanPhase(StrEnum):
    """How far the conversation has come."""

    STOPPING = "stopping"
    ASKING_INFO = "asking_info"
    ASKING_HEALTH = "asking_health"
    RESETTING = "resetting"
    SCANNING = "scanning"


PATIENCE_S = {
    ScanPhase.STOPPING: 0.1,
    ScanPhase.ASKING_INFO: 0.5,
    ScanPhase.ASKING_HEALTH: 0.5,
    ScanPhase.RESETTING: 1.0,
    ScanPhase.SCANNING: 4.0,
}
"""Longest silence before the conversation starts again; a motor reaches its speed in two seconds (assumed)."""


class _TurnBuilder(MutableState):
    """Points of either scan to turns; a beam's time is by its share of the turn, which ends when that was read."""

    passed_over: Counter[str] = field(default_factory=Counter)
    _points_s: list[float] = []  # of the last turns
    _began_s: float | None = None
    _angle_q6: list[float] = []
    _range_m: list[float] = []
    _quality: list[int] = []  # one for each range in a standard scan, none in an express scan
    _point_s: float = 0.0
    _capsule: Capsule | None = None
    _axis_q6: float = 0.0  # where the lidar looked last, in an express scan

    def begin(self) -> None:
        """A scan begins: the turn in progress will not be whole."""
        self.restore(_TurnBuilder(passed_over=self.passed_over))

    def take_node(self, node: ScanNode, now_s: float, behind: int) -> LidarTurn | None:
        """A point of a standard scan; ``behind`` is how many came after it in the same read."""
        turn = self._end_turn(now_s - behind * self._point_s) if node.starts_turn else None
        if self._add(node.angle_q6, node.distance_q2 / 4000):
            self._quality.append(node.quality)
        return turn

    def take_capsule(self, capsule: Capsule, now_s: float, behind: int) -> LidarTurn | None:
        """A capsule of an express scan: the points of the one before it have their angles now."""
        before, self._capsule = self._capsule, capsule
        if before is None or capsule.is_first:
            return None
        step_q6 = (capsule.start_q6 - before.start_q6) % FULL_TURN_Q6 / POINTS
        turn = None
        for index, (range_mm, offset_q3) in enumerate(zip(before.distance_mm, before.offset_q3, strict=True)):
            angle_q6 = (before.start_q6 + step_q6 * index) % FULL_TURN_Q6
            if angle_q6 + FULL_TURN_Q6 / 2 < self._axis_q6:  # the zero mark was passed
                points_behind = (behind + 2) * POINTS - index
                turn = self._end_turn(now_s - points_behind * self._point_s)
            self._axis_q6 = angle_q6
            self._add(angle_q6 - 8 * offset_q3, range_mm / 1000)
        return turn

    def _add(self, angle_q6: float, range_m: float) -> bool:
        """Whether the point is kept: it is of a turn that was heard from its beginning."""
        is_kept = self._began_s is not None and len(self._angle_q6) < FULL_TURN_Q6
        if is_kept:
            self._angle_q6.append(angle_q6)
            self._range_m.append(range_m)
        return is_kept

    def _end_turn(self, now_s: float) -> LidarTurn | None:
        """The points since the zero mark was last passed."""
        began_s, self._began_s = self._began_s, now_s
        angle_q6, range_m = np.array(self._angle_q6), np.array(self._range_m)
        quality = np.array(self._quality, float) if self._quality else None
        self._angle_q6, self._range_m, self._quality = [], [], []
        if began_s is None:
            return None
        if len(angle_q6) < LEAST_NODES or np.ptp(angle_q6) < LEAST_COVERED * FULL_TURN_Q6:
            self.passed_over["incomplete"] += 1
            return None
        if not 0 < now_s - began_s <= LONGEST_TURN_S:
            self.passed_over["interrupted"] += 1
            return None
        took_s = self._steadied_s(now_s - began_s, len(angle_q6))
        self._point_s = took_s / len(angle_q6)
        share = np.clip(angle_q6 / FULL_TURN_Q6, 0.0, 1.0)
        clockwise_rad = angle_q6 * (math.tau / FULL_TURN_Q6)
        if quality is not None and len(quality) != len(range_m):
            quality = None  # a part of the turn was of an express scan, or restored without it
        return LidarTurn(clockwise_rad, range_m, now_s - (1 - share) * took_s, quality)

    def _steadied_s(self, took_s: float, points: int) -> float:
        """How long the turn took; where that is far from what the last ones did, as long as those."""
        self._points_s = [*self._points_s[-STEADY_TURNS + 1 :], took_s / points]
        usual_s = median(self._points_s) * points
        if len(self._points_s) < STEADY_AFTER or abs(took_s - usual_s) <= UNSTEADY_SHARE * usual_s:
            return took_s
        return usual_s


class RplidarState(MutableState, tag="rplidar"):
    """How far the conversation has come, and the turn in progress."""

    decoder: RplidarDecoderState
    turns: _TurnBuilder
    has_express: bool
    phase: ScanPhase = ScanPhase.STOPPING
    heard_s: float = 0.0
    words: bytes = b""
    awaits_scan: bool = False
    packets: int = 0
    complaint: str = ""
    info: DeviceInfo | None = None


class RplidarReader(StatefulPart[RplidarState]):
    """``poll`` says what is to be written: the next request, or the first one again where no answer came."""

    def __init__(self, model: LidarModel, baud: int, *, express: bool) -> None:
        self._model, self._wants_express = model, express
        self._decoder, self._turns = RplidarDecoder(), _TurnBuilder()
        self.memory = RplidarState(self._decoder.state(), self._turns, express)
        self.parts = {"decoder": self._decoder, "turns": self._turns}

    @property
    def packets(self) -> int:
        """Answers so far."""
        return self.memory.packets

    @property
    def awaits_scan(self) -> bool:
        """Whether a scan was asked for, and no point of it has come."""
        return self.memory.awaits_scan

    @property
    def complaint(self) -> str:
        """What the lidar itself says is wrong with it; empty where it says nothing."""
        return self.memory.complaint

    @property
    def refused(self) -> Counter[str]:
        """Skipped bytes, and dropped incomplete turns (``incomplete``)."""
        return self._decoder.refused + self._turns.passed_over

    def begin(self, now_s: float) -> bytes:
        """Begin a connection: stop a scan that may still run."""
        self.memory.complaint, self.memory.info, self.memory.words = "", None, b""
        self.memory.has_express = self._wants_express
        self._go(ScanPhase.STOPPING, now_s, request(RequestCode.STOP))
        return self.poll(now_s)

    def read_bytes(self, data: bytes, now_s: float) -> list[LidarTurn]:
        """The turns that these bytes complete."""
        if self.memory.phase in (
            ScanPhase.STOPPING,
            ScanPhase.RESETTING,
        ):  # the rest of a scan, or what a start prints
            return []
        turns = []
        answers = self._decoder.feed_bytes(data)
        for behind, answer in zip(range(len(answers) - 1, -1, -1), answers, strict=True):
            self.memory.packets += 1
            self.memory.heard_s = now_s
            if isinstance(answer, ScanNode | Capsule):
                self.memory.awaits_scan = False
            turn = self._take_answer(answer, now_s, behind)
            if turn is not None:
                turns.append(turn)
        return turns

    def poll(self, now_s: float) -> bytes:
        """What is to be written now."""
        if now_s - self.memory.heard_s >= PATIENCE_S[self.memory.phase]:
            self._run_out(now_s)
        words, self.memory.words = self.memory.words, b""
        return words

    def end(self) -> bytes:
        """The scan is stopped, and an A2's motor with it."""
        stopped = motor_request(0) if self._model is LidarModel.RPLIDAR_A2 else b""
        return request(RequestCode.STOP) + stopped

    def _run_out(self, now_s: float) -> None:
        """A phase has timed out: go on after a stop or a reset, start again after a silence."""
        if self.memory.phase is ScanPhase.STOPPING:
            self._go(ScanPhase.ASKING_INFO, now_s, request(RequestCode.GET_INFO))
            return
        if self.memory.phase is ScanPhase.SCANNING and self.memory.awaits_scan:
            self.memory.has_express = False  # the device may have promised more than it does
        self._go(ScanPhase.STOPPING, now_s, request(RequestCode.STOP))

    def _go(self, phase: ScanPhase, now_s: float, words: bytes) -> None:
        self.memory.phase, self.memory.heard_s = phase, now_s
        self.memory.awaits_scan = phase is ScanPhase.SCANNING
        self.memory.words += words
        self._decoder.reset()
        self._turns.begin()

    def _take_answer(self, answer: Answer, now_s: float, behind: int) -> LidarTurn | None:
        match answer:
            case DeviceInfo() if self.memory.phase is ScanPhase.ASKING_INFO:
                self.memory.info, self.memory.complaint = answer, self._complaint_about(answer)
                self._go(ScanPhase.ASKING_HEALTH, now_s, request(RequestCode.GET_HEALTH))
            case DeviceHealth() if self.memory.phase is ScanPhase.ASKING_HEALTH:
                self._take_health(answer, now_s)
            case ScanNode() if self.memory.phase is ScanPhase.SCANNING:
                return self._turns.take_node(answer, now_s, behind)
            case Capsule() if self.memory.phase is ScanPhase.SCANNING:
                return self._turns.take_capsule(answer, now_s, behind)
        return None

    def _take_health(self, health: DeviceHealth, now_s: float) -> None:
        if health.status is HealthStatus.ERROR:
            self.memory.complaint = Sentence(
                "lidar.defective",
                "the lidar reports that it is defective (error {code})",
                code=health.error_code,
            )
            self._go(ScanPhase.RESETTING, now_s, request(RequestCode.RESET))
            return
        offered = self.memory.info is not None and self.memory.info.firmware >= EXPRESS_SINCE
        motor = motor_request(MOTOR_PWM) if self._model is LidarModel.RPLIDAR_A2 else b""
        start = express_request() if self.memory.has_express and offered else request(RequestCode.SCAN)
        self._go(ScanPhase.SCANNING, now_s, motor + start)

    def _complaint_about(self, info: DeviceInfo) -> str:
        if info.model >> 4 == SERIES[self._model]:
            return ""
        return f"another lidar: it reports model 0x{info.model:02x}, but the configuration says {self._model}"
