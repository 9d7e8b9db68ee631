"""The simulated LD19: its bytes, read by the decoder that reads the real one's."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest

from chefbotd.components.simulation import scene
from chefbotd.components.simulation.lidar_devices import SimulatedLd19
from chefbotd.components.simulation.parameters.simulation import LidarFlaws
from chefbotd.components.simulation.spinning import LidarMount, Sight
from chefbotd.components.simulation.worlds.building import Material, Placement, box
from chefbotd.core.geometry import Pose2D
from firmware_protocol.lidar.ld19 import Ld19Decoder, Ld19Packet

PERFECT: dict[str, Any] = {"noise_m": 0, "lost_share": 0, "rate_error_share": 0, "rate_wobble_share": 0}
ROOM = scene.of_walls(np.array([[2, -3, 2, 3], [2, 3, -4, 3], [-4, 3, -4, -3], [-4, -3, 2, -3]], np.float64))
STANDING = np.array([[0.0, 0.0, 0.0, 0.0]])
NOBODY = np.zeros((0, 3))
MIDDLE = LidarMount()


class Beams(NamedTuple):
    """Points in the order in which they were measured: seconds, clockwise angle, distance."""

    at_s: np.ndarray
    angle_rad: np.ndarray
    distance_m: np.ndarray
    intensity: np.ndarray


def a_lidar(
    mount: LidarMount = MIDDLE, where: scene.Scene = ROOM, seed: int = 1, **values: Any
) -> SimulatedLd19:
    """A perfect lidar in a room of 6 by 6 m, unless told otherwise."""
    flaws = LidarFlaws.model_validate({**PERFECT, **values})
    return SimulatedLd19(flaws, mount, Sight(where, 0.2, flaws), seed)


def packets(
    lidar: SimulatedLd19,
    seconds: float,
    trail: np.ndarray = STANDING,
    step_s: float = 0.01,
    discs: np.ndarray = NOBODY,
) -> list[Ld19Packet]:
    """What it sends, asked in steps; the decoder refuses none of it."""
    decoder, read = Ld19Decoder(), []
    for number in range(1, round(seconds / step_s) + 1):
        read += decoder.feed_bytes(b"".join(lidar.send_packets(number * step_s, trail, discs)))
    assert not decoder.refused
    return read


def beams(read: list[Ld19Packet]) -> Beams:
    """All their points."""
    angles = np.concatenate([packet.angles_cdeg() for packet in read]) * (math.pi / 18_000)
    distances = np.concatenate([packet.distance_mm for packet in read]) / 1000
    intensity = np.concatenate([packet.intensity for packet in read])
    return Beams(np.arange(len(angles)) / 4500, angles, distances, intensity)


def test_packets_come_as_from_the_real_one() -> None:
    """4500 points a second, 12 a packet, 3600 degrees a second, stamps in ms of the last point, which wrap at 30 s."""
    read = packets(a_lidar(), 31.0, step_s=0.1)
    assert len(read) == 31 * 375 - 1  # the last one is on its way
    assert {packet.speed_deg_s for packet in read} == {3600}
    assert {packet.span_cdeg for packet in read} <= {879, 880, 881}
    assert [packet.stamp_ms for packet in read[:3]] == [2, 5, 7]
    assert [packet.stamp_ms for packet in read[11_249:11_251]] == [29_999, 2]
    after = [(b.start_cdeg - a.start_cdeg) % 36_000 for a, b in pairwise(read)]
    assert min(after) >= 959
    assert max(after) <= 961


def test_angles_grow_clockwise_and_distances_are_those_of_the_walls() -> None:
    """To the wall at x = 2: 2 / cos(angle). To the right of the zero mark, at y = -3, angles are 90 degrees."""
    seen = beams(packets(a_lidar(), 0.3))
    ahead = np.cos(seen.angle_rad) > 0.9
    assert seen.distance_m[ahead] == pytest.approx(2 / np.cos(seen.angle_rad[ahead]), abs=0.001)
    right = np.abs(seen.angle_rad - math.pi / 2) < 0.3
    assert seen.distance_m[right] == pytest.approx(3 / np.sin(seen.angle_rad[right]), abs=0.001)
    assert ahead.sum() > 150


@pytest.mark.parametrize(("upside_down", "sense"), [(False, -1), (True, 1)])
def test_the_mount_counts(upside_down: bool, sense: int) -> None:
    """At (0.3, -0.2), zero mark at 0.7 rad, on a robot at (-1, 0.5) turned by 0.4; angles the other way."""
    mount = LidarMount("side", Pose2D(0.3, -0.2, 0.7), upside_down)
    trail = np.array([[0.0, -1.0, 0.5, 0.4]])
    seen = beams(packets(a_lidar(mount), 0.3, trail))
    x = -1 + 0.3 * math.cos(0.4) + 0.2 * math.sin(0.4)
    bearing = 0.4 + 0.7 + sense * seen.angle_rad
    ahead = np.cos(bearing) > 0.9
    assert seen.distance_m[ahead] == pytest.approx((2 - x) / np.cos(bearing[ahead]), abs=0.001)
    assert ahead.sum() > 150


def test_each_point_is_measured_from_where_the_robot_is_then() -> None:
    """Driving at 0.5 m/s from x = -1 and turning by 1 rad/s: the wall at 2 m is (3 - 0.5 t) / cos(t - angle) away."""
    at_s = np.linspace(0, 2, 401)
    trail = np.stack([at_s, -1 + 0.5 * at_s, 0 * at_s, at_s], axis=1)
    seen = beams(packets(a_lidar(), 2.0, trail))
    bearing = seen.at_s - seen.angle_rad
    ahead = np.cos(bearing) > 0.95
    expected = (3 - 0.5 * seen.at_s) / np.cos(bearing)
    assert seen.distance_m[ahead] == pytest.approx(expected[ahead], abs=0.0015)


def test_how_often_it_is_asked_changes_nothing() -> None:
    """Every 10 ms, every 70 ms: the same bytes, with noise and losses."""
    flaws: dict[str, Any] = {"noise_m": 0.01, "lost_share": 0.1, "rate_wobble_share": 0.01}
    often, seldom = (packets(a_lidar(seed=4, **flaws), 4.2, step_s=step_s) for step_s in (0.01, 0.07))
    assert often == seldom
    assert packets(a_lidar(seed=5, **flaws), 4.2) != often


def test_it_is_as_noisy_and_as_lossy_as_told() -> None:
    """A centimetre of noise on a wall at 2 m, and one reading of ten lost (0)."""
    seen = beams(packets(a_lidar(noise_m=0.01, lost_share=0.1), 20.0, step_s=0.1))
    assert (seen.distance_m == 0).mean() == pytest.approx(0.1, abs=0.005)
    ahead = (np.cos(seen.angle_rad) > 0.95) & (seen.distance_m > 0)
    error = seen.distance_m[ahead] - 2 / np.cos(seen.angle_rad[ahead])
    assert error.std() == pytest.approx(0.01, rel=0.05)
    assert error.mean() == pytest.approx(0, abs=0.0005)
    assert (seen.intensity[seen.distance_m == 0] == 0).all()


def test_the_motors_rate_is_off_and_wobbles() -> None:
    """Off by less than a hundredth, another for each seed, and changing while it runs."""
    rates = []
    for seed in (1, 2):
        read = packets(a_lidar(seed=seed, rate_error_share=0.003, rate_wobble_share=0.004), 3.0)
        speeds = [packet.speed_deg_s for packet in read]
        assert max(speeds) - min(speeds) == pytest.approx(2 * 0.004 * 3600, abs=4)
        rates.append(np.mean(speeds))
    assert rates[0] != pytest.approx(rates[1], abs=1)
    assert rates == pytest.approx([3600, 3600], rel=0.01)


def test_what_is_too_far_or_too_near_is_no_reading() -> None:
    """Walls at 2 m to 5 m with a band of 2.5 to 3.5 m: 0 outside it."""
    seen = beams(packets(a_lidar(min_range_m=0.9, max_range_m=3.5), 0.3, np.array([[0.0, 1.2, 0, 0]])))
    ahead, right = np.cos(seen.angle_rad) > 0.95, np.abs(seen.angle_rad - math.pi / 2) < 0.1
    behind = np.cos(seen.angle_rad) < -0.95
    assert (seen.distance_m[ahead] == 0).sum() > 0.9 * ahead.sum()  # 0.8 m
    assert (seen.distance_m[behind] == 0).all()  # 5.2 m
    assert (seen.distance_m[right] > 2.9).all()


def test_glass_returns_what_meets_it_squarely_and_lets_through_the_rest() -> None:
    """A pane at x = 1 before the wall at 2: its own 1 m within acos(0.97) = 14 degrees, the wall's 2 m beyond."""
    pane = box("pane", Placement(1.0, -3.0), 0.04, 6.0, 2.0, material=Material.GLASS)
    glass, walls = scene.of_solids([pane]), ROOM
    room = scene.Scene(
        np.vstack([walls.edges, glass.edges]),
        np.concatenate([walls.bottom_m, glass.bottom_m]),
        np.concatenate([walls.top_m, glass.top_m]),
        np.concatenate([walls.material, glass.material]),
    )
    seen = beams(packets(a_lidar(where=room), 0.3))
    off_rad = np.abs((seen.angle_rad + math.pi) % math.tau - math.pi)
    squarely, oblique = off_rad < 0.24, (off_rad > 0.25) & (off_rad < 0.6)
    assert seen.distance_m[squarely] == pytest.approx(1 / np.cos(off_rad[squarely]), abs=0.001)
    assert seen.distance_m[oblique] == pytest.approx(2 / np.cos(off_rad[oblique]), abs=0.001)
    assert set(seen.intensity[squarely]) == {120}


def test_black_is_seen_from_near_only() -> None:
    """A black cupboard at 1 m with its surfaces seen up to 1.2 m: dim within, no reading beyond."""
    black = scene.of_solids([box("cupboard", Placement(1.0, -3.0), 1.0, 6.0, 2.0, material=Material.BLACK)])
    seen = beams(packets(a_lidar(where=black, black_range_m=1.2), 0.3))
    off_rad = np.abs((seen.angle_rad + math.pi) % math.tau - math.pi)
    limit_rad = math.acos(1 / 1.2)
    assert (seen.distance_m[off_rad < limit_rad - 0.01] > 0.99).all()
    assert set(seen.intensity[off_rad < limit_rad - 0.01]) == {40}
    assert (seen.distance_m[off_rad > limit_rad + 0.01] == 0).all()


def test_people_are_seen_before_walls() -> None:
    """A disc of 0.25 m at (1.2, 0): 0.95 m ahead."""
    seen = beams(packets(a_lidar(), 0.3, discs=np.array([[1.2, 0.0, 0.25]])))
    assert seen.distance_m.min() == pytest.approx(0.95, abs=0.001)


def test_a_stalled_motor_measures_in_one_direction_until_it_is_released() -> None:
    """From 1 s to 2 s speed 0 and the same angle; then it goes on from there."""
    lidar = a_lidar()
    before = packets(lidar, 1.0)
    lidar.stall(1.0)
    decoder = Ld19Decoder()

    def until(from_s: float, to_s: float) -> list[Ld19Packet]:
        steps = np.arange(from_s, to_s, 0.01) + 0.01
        sent = [b"".join(lidar.send_packets(float(step), STANDING, NOBODY)) for step in steps]
        return decoder.feed_bytes(b"".join(sent))

    stalled = until(1.0, 2.0)[2:]
    assert {(packet.speed_deg_s, packet.span_cdeg) for packet in stalled} == {(0, 0)}
    lidar.release(2.0)
    after = until(2.0, 2.2)[2:]
    assert {packet.speed_deg_s for packet in after} == {3600}
    assert (after[0].start_cdeg - before[-1].start_cdeg) % 36_000 < 6_000


def test_after_a_long_gap_only_the_present_is_measured() -> None:
    """Not asked for 5 s: 0.4 s are measured, the rest is counted, and points are what they would have been."""
    late, steady = a_lidar(noise_m=0.01), a_lidar(noise_m=0.01)
    read = packets(late, 5.0, step_s=5.0)
    assert read == packets(steady, 5.0)[-len(read) :]
    assert late.packets_skipped == 375 * 5 - 1 - len(read)
    assert 140 <= len(read) <= 151
