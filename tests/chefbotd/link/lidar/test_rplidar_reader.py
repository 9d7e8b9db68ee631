"""The conversation with an RPLIDAR, and its nodes and capsules to whole turns."""

import numpy as np
import pytest

from chefbotd.link.lidar.rplidar_reader import RplidarReader, ScanPhase
from chefbotd.link.lidar.turn import LidarTurn
from chefbotd.sensing.lidar import LidarModel
from firmware_protocol.lidar.rplidar import EXPRESS_SCAN, HealthStatus, RequestCode, motor_request
from tests.fakes.lidar import FakeRplidar, noisy_box

A1, A2 = LidarModel.RPLIDAR_A1, LidarModel.RPLIDAR_A2


class Talk:
    """A reader and a fake device, step by step of 10 ms; what the device says comes in reads of ``size``."""

    def __init__(self, device: FakeRplidar, model: LidarModel = A1, *, express: bool = False, size: int = 64):
        self.device, self.reader = device, RplidarReader(model, 115_200, express=express)
        self.turns: list[LidarTurn] = []
        self.now_s, self._size = 10.0, size
        self._unread = b""
        device.sent = self._keep
        device.receive(self.reader.begin(self.now_s))

    def _keep(self, data: bytes) -> None:
        self._unread += data

    def run(self, seconds: float) -> "Talk":
        """Let time pass."""
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            self.device.turn()
            unread, self._unread = self._unread, b""
            for at in range(0, len(unread), self._size):
                self.turns += self.reader.read_bytes(unread[at : at + self._size], self.now_s)
            self.device.receive(self.reader.poll(self.now_s))
        return self


@pytest.mark.parametrize("size", [1, 7, 64, 4096])
def test_it_stops_asks_and_scans(size: int) -> None:
    """Stop, information, health, scan; then ten turns of 360 beams a second, in any chunks."""
    talk = Talk(FakeRplidar(noisy_box()), size=size).run(1.3)
    assert talk.device.requests == [
        RequestCode.STOP,
        RequestCode.GET_INFO,
        RequestCode.GET_HEALTH,
        RequestCode.SCAN,
    ]
    assert talk.reader.memory.phase is ScanPhase.SCANNING
    assert 9 <= len(talk.turns) <= 11
    assert {len(turn.range_m) for turn in talk.turns} == {360}
    assert not talk.reader.refused
    assert talk.reader.memory.info is not None
    assert (talk.reader.memory.info.model, talk.reader.memory.info.firmware) == (0x18, (1, 17))


def test_ranges_and_times_stand_at_their_angles() -> None:
    """The wall at a quarter clockwise is 1 m away; a turn takes 0.1 s, and a quarter of it passes before that beam."""
    turn = Talk(FakeRplidar(noisy_box())).run(1.0).turns[-1]
    assert turn.range_m[90] == pytest.approx(1.0, abs=0.03)
    assert turn.range_m[180] == pytest.approx(2.0, abs=0.03)
    assert np.degrees(turn.clockwise_rad) == pytest.approx(np.arange(360))
    assert turn.stamp_s[-1] - turn.stamp_s[0] == pytest.approx(0.1 * 359 / 360, abs=0.002)
    assert turn.stamp_s[90] - turn.stamp_s[0] == pytest.approx(0.025, abs=0.002)


@pytest.mark.parametrize("late_s", [0.04, 0.07, 0.15])
def test_a_host_that_reads_late_makes_no_turn_shorter_or_longer(late_s: float) -> None:
    """What waited for it comes at once: the motor has not changed its rate, so beams keep their distance in time."""
    talk = Talk(FakeRplidar(noisy_box())).run(1.0)
    for _ in range(round(late_s / 0.01)):
        talk.now_s += 0.01
        talk.device.turn()
    talk.run(0.5)
    took_s = [float(turn.stamp_s[-1] - turn.stamp_s[0]) for turn in talk.turns[3:]]
    assert took_s == pytest.approx([0.1 * 359 / 360] * len(took_s), rel=0.2)
    steady_s = [float(turn.stamp_s[-1] - turn.stamp_s[0]) for turn in talk.turns[-2:]]
    assert steady_s == pytest.approx([0.1 * 359 / 360] * 2, abs=0.003)


def test_an_express_scan_is_asked_for_where_it_is_offered() -> None:
    """By firmware 1.17: 320 beams a turn, at their angles. Not by 1.16, and not where the configuration says so."""
    talk = Talk(FakeRplidar(noisy_box()), express=True).run(1.5)
    assert talk.device.requests[-1] == EXPRESS_SCAN
    assert len(talk.turns) >= 9
    for turn in talk.turns:
        assert len(turn.range_m) == 320
        expected = np.minimum(
            2 / abs(np.cos(turn.clockwise_rad)), 1 / (abs(np.sin(turn.clockwise_rad)) + 1e-9)
        )
        assert abs(turn.range_m - expected).max() < 0.04
    old = Talk(FakeRplidar(noisy_box(), firmware=(1, 16)), express=True).run(0.5)
    assert old.device.requests[-1] == RequestCode.SCAN


def test_an_express_scan_that_does_not_come_is_given_up() -> None:
    """After 4 s without a capsule the device is stopped and asked for the standard scan."""
    device = FakeRplidar(noisy_box())
    device.offers_express = False
    talk = Talk(device, express=True).run(6.0)
    assert EXPRESS_SCAN in device.requests
    assert device.requests[-4:] == [
        RequestCode.STOP,
        RequestCode.GET_INFO,
        RequestCode.GET_HEALTH,
        RequestCode.SCAN,
    ]
    assert len(talk.turns) > 5


def test_a_device_that_is_out_of_order_is_reset() -> None:
    """What it prints at its start is no answer; then it is asked anew, and scans."""
    device = FakeRplidar(noisy_box())
    device.health = HealthStatus.ERROR
    talk = Talk(device).run(0.2)
    assert "defective (error 4660)" in talk.reader.complaint
    talk.run(2.5)
    assert RequestCode.RESET in device.requests
    assert device.scanning == "standard"
    assert talk.reader.complaint == ""
    assert len(talk.turns) > 5


def test_a_device_that_lost_its_power_is_asked_anew() -> None:
    """Switched off in mid-scan and on again: 4 s later it is scanned again."""
    talk = Talk(FakeRplidar(noisy_box())).run(1.0)
    talk.device.scanning = None
    before = len(talk.turns)
    talk.run(3.9)
    assert len(talk.turns) == before
    talk.run(1.5)
    assert len(talk.turns) > before + 5


def test_another_model_is_told() -> None:
    """It says 0x28, an A2, where an A1 is configured; it is read all the same."""
    talk = Talk(FakeRplidar(noisy_box(), model=0x28)).run(1.0)
    assert (
        "another lidar: it reports model 0x28, but the configuration says rplidar_a1" in talk.reader.complaint
    )
    assert talk.turns


def test_an_a2_s_motor_is_started_and_stopped_by_its_own_request() -> None:
    """F0 with 660, and 0 at the end; the checksum is the XOR of all before: A5 F0 02 94 02 make C1."""
    assert motor_request(660) == bytes.fromhex("A5 F0 02 94 02 C1")
    talk = Talk(FakeRplidar(noisy_box(), model=0x28), A2).run(0.5)
    assert talk.device.requests[-2:] == [0xF0, RequestCode.SCAN]
    assert talk.reader.end() == bytes.fromhex("A5 25 A5 F0 02 00 00 57")


def test_damaged_bytes_cost_beams_and_make_no_wrong_ones() -> None:
    """One bit in every 700 bytes flipped: what is left of each turn stands at its angle, or there is no turn."""
    device = FakeRplidar(noisy_box())
    talk = Talk(device)
    keep, count = device.sent, 0

    def damage(data: bytes) -> None:
        nonlocal count
        count += len(data)
        if count > 700 and device.scanning:
            count -= 700
            data = bytes([data[0] ^ 0x01]) + data[1:]
        keep(data)

    device.sent = damage
    talk.run(2.0)
    assert len(talk.turns) > 5
    assert talk.reader.refused["scan"] > 10
    for turn in talk.turns:
        expected = np.minimum(
            2 / abs(np.cos(turn.clockwise_rad)), 1 / (abs(np.sin(turn.clockwise_rad)) + 1e-9)
        )
        assert abs(turn.range_m - expected).max() < 0.05


def test_after_a_pause_no_turn_is_patched_together() -> None:
    """The host stood still for 1.5 s in mid-turn, and what was lost meanwhile does not matter."""
    talk = Talk(FakeRplidar(noisy_box())).run(1.05)
    before = len(talk.turns)
    talk.now_s += 1.5
    talk.run(0.1)
    assert len(talk.turns) == before
    assert talk.reader.refused["interrupted"] == 1
    talk.run(0.3)
    assert len(talk.turns) > before


def test_a_pause_of_an_express_scan_is_no_reason_to_give_it_up() -> None:
    """Something held the motor for 6 s after scans had come: express again; and so after another connection."""
    device = FakeRplidar(noisy_box())
    talk = Talk(device, express=True).run(1.5)
    device.motor_turns = False
    talk.run(6.0)
    device.motor_turns = True
    talk.run(1.5)
    assert device.scanning == "express"
    assert RequestCode.SCAN not in device.requests
