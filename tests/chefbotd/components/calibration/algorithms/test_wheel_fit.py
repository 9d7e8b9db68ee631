"""The wheels' parameters from motions that were seen: exact ones, scattering ones, and kinds of drives."""

import math

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.wheel_fit import RecordedDrive, fit, in_pieces, needs_rich
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, WheelModel, dead_reckon
from chefbotd.core.poses import between, compose

TRACK_M = 0.3
MOUNT = np.array([0.06, -0.02, 0.3])
WRONG = WheelModel(left=1.006, right=0.995, track=1.02)

SQUARE = [(1.0, 0.0, 50), (0.0, math.pi / 2, 30)] * 4
CIRCLE = [(3.0, 2 * math.pi, 150)]
ARCS = [(1.0, math.pi, 50), (1.0, -math.pi / 2, 50), (1.0, 0.0, 40)] * 2
"""Travel in m, turn in rad, and the number of steps."""


def _rolled(path: list[tuple[float, float, int]], sign: int = 1) -> tuple[Floats, Floats]:
    """How far both sides roll in each step, nominally."""
    left = [np.full(n, (way_m - sign * turn_rad * TRACK_M / 2) / n) for way_m, turn_rad, n in path]
    right = [np.full(n, (way_m + sign * turn_rad * TRACK_M / 2) / n) for way_m, turn_rad, n in path]
    return np.concatenate(left), np.concatenate(right)


def _drive(
    path: list[tuple[float, float, int]],
    model: WheelModel,
    *,
    kind: str = "",
    sign: int = 1,
    mount: Floats | None = None,
    yaw_rad: float = 0.0,
    scatter: float = 0.0,
    seed: int = 0,
) -> RecordedDrive:
    """A drive whose truth is ``model``; ``scatter`` is how far each step's turn is off (a share of what wheels do)."""
    left_m, right_m = _rolled(path, sign)
    random = np.random.default_rng(seed)
    turned = np.abs(right_m - left_m) / TRACK_M
    slip_m = scatter * np.sqrt(2.5e-5 * turned) * random.normal(0, 1, len(left_m)) * TRACK_M / 2
    poses = dead_reckon(model, TRACK_M, left_m - slip_m, right_m + slip_m)
    seen = compose(poses, mount if mount is not None else np.array([0.0, 0.0, yaw_rad]))
    first, last, motion, shares = in_pieces(seen, (40, 120), 10)
    return RecordedDrive(
        kind, kind, left_m, right_m, first, last, motion, np.full((len(first), 3), 1e-3), shares
    )


def test_a_quarter_turn_about_the_standing_left_wheel() -> None:
    """Track 1 m, left still, right rolls pi/2 m: the pose is (0.5, 0.5, 90 degrees)."""
    poses = dead_reckon(NOMINAL, 1.0, np.zeros(100), np.full(100, math.pi / 200))
    assert poses[-1] == pytest.approx([0.5, 0.5, math.pi / 2])


def test_the_track_depends_on_the_share_of_spin() -> None:
    """A tenth wider on the spot: a turn of 1.1 rad becomes one of 1 rad; straight ahead changes nothing."""
    model = WheelModel(spin=0.1)
    assert dead_reckon(model, 1.0, np.array([-0.55]), np.array([0.55]))[-1, 2] == pytest.approx(1.0)
    assert dead_reckon(model, 1.0, np.ones(3), np.ones(3))[-1] == pytest.approx([3.0, 0.0, 0.0])


def test_parameters_are_recovered_from_drives_with_truth() -> None:
    """A square and a circle each way, the truth's yaw half a degree off: radii and track to 1e-5."""
    drives = [
        _drive(path, WRONG, sign=sign, yaw_rad=math.radians(0.5))
        for path in (SQUARE, CIRCLE)
        for sign in (1, -1)
    ]
    model = fit(TRACK_M, drives).model
    assert (model.left, model.right, model.track) == pytest.approx(
        (WRONG.left, WRONG.right, WRONG.track), abs=1e-5
    )


TO_AND_FRO = [
    (0.4, 0.0),
    (-0.4, 0.0),
    (0.0, 2.0),
    (0.0, -2.0),
    (0.8, 1.0),
    (-0.8, 0.0),
    (0.2, 0.0),
    (-0.9, 0.5),
] * 2
"""Travel in m and turn in rad from stop to stop."""


def _with_play(play_m: float) -> RecordedDrive:
    """Stop and go by ``WRONG``: the first step of a side that turns round is in vain by the play."""
    sides = [np.array([way + sign * turn * TRACK_M / 2 for way, turn in TO_AND_FRO]) for sign in (-1, 1)]
    steps = [np.repeat(side / 20, 20) for side in sides]
    poses = compose(dead_reckon(WRONG, TRACK_M, *steps), MOUNT)
    for side, rolled in zip(sides, steps, strict=True):
        turns_round = np.flatnonzero(np.diff(np.sign(side))) + 1
        rolled[20 * turns_round] += play_m * np.sign(side[turns_round])
    stops = np.arange(0, len(steps[0]) + 1, 20)
    first, last, motion, shares = in_pieces(poses[stops], (1,), 1)
    sigmas = np.full((len(first), 3), 1e-3)
    return RecordedDrive(
        "", "", steps[0], steps[1], stops[first], stops[last], motion, sigmas, shares * len(shares)
    )


def test_play_between_encoders_and_wheels_does_not_make_radii_smaller() -> None:
    """A millimetre at the rim shortens each way: radii come out 6e-4 too small. With it in the fit, all is right."""
    right = np.array([WRONG.left, WRONG.right, WRONG.track])
    blind = fit(TRACK_M, [_with_play(1e-3)], mount=MOUNT).model
    assert np.abs(np.array([blind.left, blind.right]) / right[:2] - 1).min() > 6e-4
    seen = fit(TRACK_M, [_with_play(1e-3)], mount=MOUNT, has_play=True)
    assert seen.play_m == pytest.approx(1e-3, abs=1e-4)
    assert np.array([seen.model.left, seen.model.right, seen.model.track]) == pytest.approx(right, abs=2e-4)


def test_without_play_none_is_found() -> None:
    """Gears without it: what is found is next to nothing, and the radii stay right."""
    seen = fit(TRACK_M, [_with_play(0.0)], mount=MOUNT, has_play=True)
    assert abs(seen.play_m) < 1e-5
    assert (seen.model.left, seen.model.right) == pytest.approx((WRONG.left, WRONG.right), abs=1e-5)


def test_the_mount_of_a_sensor_is_recovered_with_them() -> None:
    """A lidar 4 cm and 17 degrees from where it is thought to be."""
    drives = [_drive(ARCS, WRONG, sign=sign, mount=MOUNT) for sign in (1, -1)]
    result = fit(TRACK_M, drives, mount=np.array([0.02, 0.0, 0.0]))
    assert result.mount == pytest.approx(MOUNT, abs=1e-5)
    assert result.model.track == pytest.approx(WRONG.track, abs=1e-5)


def test_the_standard_deviations_are_honest() -> None:
    """Over 12 seeds of wheels that scatter, the track is off by its standard deviation in the mean square, or so."""
    off = []
    for seed in range(12):
        drives = [
            _drive(path, WRONG, sign=sign, scatter=1.0, seed=100 * seed + 10 * i + sign + 1)
            for i, path in enumerate((SQUARE, CIRCLE, ARCS) * 2)
            for sign in (1, -1)
        ]
        result = fit(TRACK_M, drives)
        off.append((result.model.track - WRONG.track) / result.sigmas[2])
    assert 0.5 < math.sqrt(np.mean(np.square(off))) < 1.6


def test_straights_alone_do_not_determine_the_track() -> None:
    """Nothing turns, so the track is undetermined, and it is said."""
    assert not fit(TRACK_M, [_drive([(3.0, 0.0, 150)], NOMINAL)]).is_determined


def test_the_richer_model_is_chosen_where_kinds_demand_it() -> None:
    """Wheels whose track is 3 % narrower on the spot: squares, circles and arcs predict each other with it only."""
    truth = WheelModel(spin=-0.03)
    paths = {"square": SQUARE, "circle": CIRCLE, "arcs": ARCS}
    drives = [
        _drive(path, truth, kind=kind, sign=sign, scatter=0.3, seed=sign + 1)
        for kind, path in paths.items()
        for sign in (1, -1)
    ]
    assert needs_rich(TRACK_M, drives)
    assert fit(TRACK_M, drives, is_rich=True).model.spin == pytest.approx(-0.03, abs=0.01)


def test_the_richer_model_is_not_chosen_for_wheels_that_are_plain_or_of_one_kind() -> None:
    """One kind of drive can never show that it is needed."""
    assert not needs_rich(
        TRACK_M, [_drive(SQUARE, WheelModel(spin=-0.03), kind="square", sign=s) for s in (1, -1)]
    )


def test_pieces_that_are_as_long_as_the_drive_are_left_out() -> None:
    """Ten steps hold pieces of 4, no piece of 20; the way from the start is asked for by 0."""
    poses = np.cumsum(np.tile([0.1, 0.0, 0.0], (11, 1)), axis=0)
    first, last, motion, shares = in_pieces(poses, (4, 20), 2)
    assert list(zip(first, last, strict=True)) == [(6, 10), (4, 8), (2, 6)]
    assert motion == pytest.approx(np.tile([0.4, 0.0, 0.0], (3, 1)))
    assert shares.sum() == pytest.approx(1.0)
    assert in_pieces(poses, (0,), 5)[1].tolist() == [10, 5]
    assert between(poses[0], poses[-1]) == pytest.approx([1.0, 0.0, 0.0])
