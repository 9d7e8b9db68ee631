"""Bundle adjustment of a lidar's stops: their poses, the walls around, and by how much the lidar reads too far.

The error of a beam is what it reads less how far the wall is in its direction; so the noise of a reading moves neither
the place on the wall nor the derivatives. Each piece of a wall is a free line; the lines are eliminated from the normal
equations (Triggs et al., "Bundle Adjustment - A Modern Synthesis", 2000, section 6.1). A constant error of the range
shows where beams meet the same wall at different angles.
"""

import math
from collections.abc import Sequence

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.scan_motion import NOISE_M, Keyframe
from chefbotd.components.calibration.algorithms.walls import Indices, wall_pieces
from chefbotd.core.poses import between, wrap
from chefbotd.core.record import Record

ROUNDS, LINE_ROUNDS = 3, 5
LEAST_PIECES, LEAST_STOPS = 6, 6
LEAST_COSINE = 0.15
"""Beams that graze a wall at less than 9 degrees are left out."""

MOST_OFF_M = 4.5 * NOISE_M
OFFSET_SIGMA_M = 0.02
"""How far lidars are expected to read off: up to some centimetres."""

POSE_SIGMA_M, POSE_SIGMA_RAD = 2e-3, 2e-3
"""Walls that leave a pose less certain do not say where the robot stood."""


class Adjusted(Record, frozen=True):
    """The poses (k, 3) in the frame of the first, and by how much the lidar reads too far, with its standard deviation.

    ``is_believed`` False: the stops do not agree on an offset, so it is 0.
    """

    poses: Floats
    offset_m: float
    offset_sigma_m: float
    is_believed: bool


class _Beams(Record, frozen=True):
    """All readings: from which stop (n,), in which direction (n, 2) and how far (n,), and their normals (n, 2)."""

    stop: Indices
    direction: Floats
    range_m: Floats
    facing: Floats


class _Lines(Record, frozen=True):
    """A line for each piece of a wall: its normal (c, 2) and a point of it (c, 2)."""

    normal: Floats
    centre: Floats


def adjust_bundle(frames: Sequence[Keyframe], poses: Floats) -> Adjusted | None:
    """The poses, from ``poses`` (k, 3) on; None where there are too few walls to say so.

    The range offset is believed only if that of every other stop explains the stops between better than none.
    """
    if len(frames) < 2 * LEAST_STOPS:
        return _solve_bundle(frames, poses, fits_offset=False)
    halves = [_solve_bundle(frames[k::2], between(poses[k], poses[k::2]), fits_offset=True) for k in (0, 1)]
    return _solve_bundle(frames, poses, fits_offset=_is_believed(halves))


def _is_believed(halves: Sequence[Adjusted | None]) -> bool:
    """Whether the offset by either half of the stops lessens the squared errors of the other, in sum."""
    one, other = halves
    if one is None or other is None:
        return False
    gains = (
        (own.offset_m**2 - (own.offset_m - foreign.offset_m) ** 2) / own.offset_sigma_m**2
        for own, foreign in ((one, other), (other, one))
    )
    return sum(gains) > 0


def _solve_bundle(frames: Sequence[Keyframe], poses: Floats, *, fits_offset: bool) -> Adjusted | None:
    beams, now, offset_m, piece = _beams(frames), poses.copy(), 0.0, np.zeros(0, np.int64)
    covariance = np.zeros((3 * len(poses) - 2, 3 * len(poses) - 2))
    for number in range(ROUNDS):
        direction, points = _place_beams(beams, now, offset_m)
        if number < 2:
            piece = wall_pieces(points, _rotate_vectors(now[beams.stop, 2], beams.facing))
        if len(np.unique(piece)) <= LEAST_PIECES:
            return None
        on = piece >= 0
        normal, gradient = _equations(
            beams.stop[on],
            now,
            direction[on],
            points[on],
            _lines(direction[on], points[on], piece[on]),
            piece[on],
        )
        certainty = 1 / OFFSET_SIGMA_M**2 if fits_offset else 1e18
        normal[-1, -1] += certainty
        gradient[-1] += certainty * offset_m
        covariance[:] = np.linalg.pinv(normal[3:, 3:], hermitian=True)  # the first pose stays where it is
        step = -covariance @ gradient[3:]
        now[1:] += step[:-1].reshape(-1, 3)
        offset_m += float(step[-1])
    sigmas = np.sqrt(np.diag(covariance)[:-1]).reshape(-1, 3)
    if not (sigmas[:, :2].max() < POSE_SIGMA_M and sigmas[:, 2].max() < POSE_SIGMA_RAD):
        return None
    now[:, 2] = wrap(now[:, 2])
    return Adjusted(now, offset_m, math.sqrt(float(covariance[-1, -1])), fits_offset)


def _beams(frames: Sequence[Keyframe]) -> _Beams:
    stop = np.repeat(np.arange(len(frames)), [len(frame.points) for frame in frames])
    points = np.concatenate([frame.points for frame in frames]).astype(np.float64)
    facing = np.concatenate([frame.facing for frame in frames]).astype(np.float64)
    range_m = np.hypot(points[:, 0], points[:, 1])
    return _Beams(stop, points / range_m[:, None], range_m, facing)


def _rotate_vectors(heading_rad: Floats, vectors: Floats) -> Floats:
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return np.stack(
        [cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]], axis=1
    )


def _place_beams(beams: _Beams, poses: Floats, offset_m: float) -> tuple[Floats, Floats]:
    """The directions of the beams and the points where they end, in the frame of the poses."""
    direction = _rotate_vectors(poses[beams.stop, 2], beams.direction)
    return direction, poses[beams.stop, :2] + (beams.range_m - offset_m)[:, None] * direction


def _lines(direction: Floats, points: Floats, piece: Indices) -> _Lines:
    """The lines that explain the ranges best."""
    count = int(piece.max()) + 1
    number = np.maximum(np.bincount(piece, minlength=count), 1)
    centre = np.stack([np.bincount(piece, points[:, k], count) / number for k in (0, 1)], axis=1)
    off = points - centre[piece]
    xx, yy, xy = (
        np.bincount(piece, value, count) for value in (off[:, 0] ** 2, off[:, 1] ** 2, off[:, 0] * off[:, 1])
    )
    along_rad = np.arctan2(2 * xy, xx - yy) / 2
    normal = np.stack([-np.sin(along_rad), np.cos(along_rad)], axis=1)
    for _ in range(LINE_ROUNDS):
        off_m, _, along_m, weight = _errors(direction, points, _Lines(normal, centre), piece)
        sums = [np.bincount(piece, weight * along_m**power, count) for power in (0, 1, 2)]
        once, twice = (np.bincount(piece, weight * off_m * along_m**power, count) for power in (0, 1))
        determinant = np.maximum(sums[0] * sums[2] - sums[1] ** 2, 1e-9)
        slope = (sums[0] * twice - sums[1] * once) / determinant
        centre = centre + ((sums[2] * once - sums[1] * twice) / determinant)[:, None] * normal
        normal = normal - slope[:, None] * np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        normal /= np.hypot(normal[:, 0], normal[:, 1])[:, None]
    return _Lines(normal, centre)


def _errors(
    direction: Floats, points: Floats, lines: _Lines, piece: Indices
) -> tuple[Floats, Floats, Floats, Floats]:
    """Of each beam: how far its end is off its line, the cosine to the normal, the place on the line, and the weight."""
    normal, off = lines.normal[piece], points - lines.centre[piece]
    off_m, cosine = (normal * off).sum(axis=1), (normal * direction).sum(axis=1)
    is_steep = np.abs(cosine) > LEAST_COSINE
    back_m = np.where(is_steep, off_m / np.where(is_steep, cosine, 1.0), 0.0)
    met = off - back_m[:, None] * direction
    along_m = normal[:, 0] * met[:, 1] - normal[:, 1] * met[:, 0]
    is_used = is_steep & (np.abs(back_m) < MOST_OFF_M)
    return (
        off_m,
        cosine,
        along_m,
        np.where(is_used, 1 / (NOISE_M * np.maximum(np.abs(cosine), LEAST_COSINE)) ** 2, 0.0),
    )


def _equations(
    stop: Indices, poses: Floats, direction: Floats, points: Floats, lines: _Lines, piece: Indices
) -> tuple[Floats, Floats]:
    """The normal matrix and the gradient over x, y and heading of each stop, and the range offset at the end."""
    off_m, cosine, along_m, weight = _errors(direction, points, lines, piece)
    normal = lines.normal[piece]
    reach = points - (off_m / np.where(weight > 0, cosine, 1.0))[:, None] * direction - poses[stop, :2]
    swing_m = normal[:, 1] * reach[:, 0] - normal[:, 0] * reach[:, 1]
    columns = np.stack([normal[:, 0], normal[:, 1], swing_m, -cosine])
    stops, pieces = len(poses), len(lines.normal)
    matrix, gradient = np.zeros((3 * stops + 1, 3 * stops + 1)), np.zeros(3 * stops + 1)
    places = [*(3 * np.arange(stops) + k for k in range(3)), np.full(stops, 3 * stops)]
    basis = np.stack([np.ones_like(along_m), along_m])
    mixed = np.zeros((pieces, len(gradient), 2))
    cells = piece * stops + stop
    for a, column in enumerate(columns):
        np.add.at(gradient, places[a], np.bincount(stop, weight * column * off_m, stops))
        for b, other in enumerate(columns):
            np.add.at(matrix, (places[a], places[b]), np.bincount(stop, weight * column * other, stops))
        for power, by in enumerate(basis):
            sums = np.bincount(cells, weight * column * by, pieces * stops).reshape(pieces, stops)
            np.add.at(mixed[:, :, power].T, places[a], sums.T)
    own = [[np.bincount(piece, weight * by * and_by, pieces) for and_by in basis] for by in basis]
    inverse = np.linalg.inv(np.moveaxis(np.array(own), -1, 0) + 1e-6 * np.eye(2))
    left = np.stack([np.bincount(piece, weight * by * off_m, pieces) for by in basis], axis=1)
    matrix -= np.einsum("cap,cpq,cbq->ab", mixed, inverse, mixed)
    gradient -= np.einsum("cap,cpq,cq->a", mixed, inverse, left)
    return matrix, gradient
