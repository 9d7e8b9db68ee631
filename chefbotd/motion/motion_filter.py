"""An extended Kalman filter for odometry in plain numbers: pose, offset of the IMU's heading, and bias.

The state is (x, y, heading, offset, bias). ``offset`` is what the IMU's heading is ahead of the heading in ``odom``.
``bias`` is that of the gyroscope where its rate turns the robot, else the rate at which the offset drifts.

What a calibration leaves uncertain is constant, so it must not be averaged away like noise. The errors of the travel's
scale, the turn's scale, the turn per metre and the scale of the IMU's heading are therefore considered, not estimated:
the filter carries their correlation with the state, and never corrects them (Schmidt, "Application of State-Space
Methods to Navigation Problems", 1966; Woodbury and Junkins, "On the Consider Kalman Filter", 2010).

An error is the true value less the estimate. Arrays would cost fifty times as much as these sums.
"""

import math
from typing import Final, TypeAlias

from chefbotd.core.geometry import Pose2D, PoseCovariance, wrap_angle
from chefbotd.core.record import Record, replace

Covariance: TypeAlias = tuple[float, ...]
"""A row for each state (x, y, heading h, offset o, bias b) from its diagonal on, and then its correlation with each
considered error: travel's scale s, turn's scale t, turn per metre m, scale of the IMU's heading g. 35 numbers.
"""

NOTHING: Final[Covariance] = (0.0,) * 35


class Considered(Record, frozen=True):
    """Variances of the considered errors: of three scales (shares), and of the turn per metre (rad²/m²)."""

    travel: float = 0.0
    turn: float = 0.0
    turn_per_m: float = 0.0
    imu_heading: float = 0.0


class MotionEstimate(Record, frozen=True):
    """The state of the filter. The heading is not wrapped; ``climb_m`` is how much higher the robot is than it began."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    offset_rad: float = 0.0
    bias_rad_s: float = 0.0
    climb_m: float = 0.0
    covariance: Covariance = NOTHING

    @property
    def odom_from_base(self) -> Pose2D:
        """The pose, with its heading in (-pi, pi]."""
        return Pose2D(self.x_m, self.y_m, wrap_angle(self.heading_rad))

    @property
    def pose_covariance(self) -> PoseCovariance:
        """The covariance of the pose."""
        c = self.covariance
        return PoseCovariance(c[0], c[1], c[2], c[9], c[10], c[17])


class MotionStep(Record, frozen=True):
    """A motion to predict: forward travel, turn, duration, and the variances of what disturbs it.

    ``travel_variance_m2`` and ``turn_variance_rad2`` are of this step, ``shared_m_rad`` is their covariance. ``climb_m``
    is how much higher the robot is afterwards.
    ``bias_turns``: the turn is a gyroscope's, so the bias acts on the heading; else it acts on the offset.
    """

    travel_m: float
    turned_rad: float
    dt_s: float
    travel_variance_m2: float
    turn_variance_rad2: float
    shared_m_rad: float
    offset_variance_rad2: float
    bias_variance_rad2_s2: float
    bias_turns: bool
    climb_m: float = 0.0


def predict(state: MotionEstimate, considered: Considered, step: MotionStep) -> MotionEstimate:
    """The state after the motion along an arc.

    The rows of x, y, heading and offset are multiplied by the Jacobian F, with the error of the turn
    ``e = t * turn + m * travel - b * dt`` (the last term only where the bias turns), and then the columns.
    """
    (
        xx, xy, xh, xo, xb, xs, xt, xm, xg,
        yy, yh, yo, yb, ys, yt, ym, yg,
        hh, ho, hb, hs, ht, hm, hg,
        oo, ob, os, ot, om, og,
        bb, bs, bt, bm, bg,
    ) = state.covariance  # fmt: skip
    travel_m, turned_rad, dt_s = step.travel_m, step.turned_rad, step.dt_s
    half_rad = turned_rad / 2
    chord_m = travel_m * (1 - half_rad * half_rad / 6)
    cos, sin = math.cos(state.heading_rad + half_rad), math.sin(state.heading_rad + half_rad)
    dx, dy = chord_m * cos, chord_m * sin
    turns_s, drifts_s = (dt_s, 0.0) if step.bias_turns else (0.0, dt_s)
    # the covariance of the turn's error with each state and each considered error
    ex = turned_rad * xt + travel_m * xm - turns_s * xb
    ey = turned_rad * yt + travel_m * ym - turns_s * yb
    eh = turned_rad * ht + travel_m * hm - turns_s * hb
    eo = turned_rad * ot + travel_m * om - turns_s * ob
    eb = turned_rad * bt + travel_m * bm - turns_s * bb
    es = -turns_s * bs
    et = turned_rad * considered.turn - turns_s * bt
    em = travel_m * considered.turn_per_m - turns_s * bm
    eg = -turns_s * bg
    # of the heading's error in the middle of the arc
    mh, mo, mb = hh + eh / 2, ho + eo / 2, hb + eb / 2
    ms, mt, mm, mg = hs + es / 2, ht + et / 2, hm + em / 2, hg + eg / 2
    # F P by rows
    x_h, y_h, h_h = xh - dy * mh + dx * hs, yh + dx * mh + dy * hs, hh + eh
    x_x = xx - dy * (xh + ex / 2) + dx * xs
    x_y = xy - dy * (yh + ey / 2) + dx * ys
    y_y = yy + dx * (yh + ey / 2) + dy * ys
    x_o, y_o, h_o = xo - dy * mo + dx * os, yo + dx * mo + dy * os, ho + eo
    x_b, y_b, h_b, o_b = (
        xb - dy * mb + dx * bs,
        yb + dx * mb + dy * bs,
        hb + eb,
        ob + drifts_s * bb + turned_rad * bg,
    )
    x_s, y_s, h_s, o_s = (
        xs - dy * ms + dx * considered.travel,
        ys + dx * ms + dy * considered.travel,
        hs + es,
        os,
    )
    o_s += drifts_s * bs
    x_t, y_t, h_t, o_t = xt - dy * mt, yt + dx * mt, ht + et, ot + drifts_s * bt
    x_m, y_m, h_m, o_m = xm - dy * mm, ym + dx * mm, hm + em, om + drifts_s * bm
    x_g, y_g, h_g, o_g = (
        xg - dy * mg,
        yg + dx * mg,
        hg + eg,
        og + drifts_s * bg + turned_rad * considered.imu_heading,
    )
    # F P F^T
    xe = turned_rad * x_t + travel_m * x_m - turns_s * x_b
    ye = turned_rad * y_t + travel_m * y_m - turns_s * y_b
    he = turned_rad * h_t + travel_m * h_m - turns_s * h_b
    q_l, q_h, q_lh = step.travel_variance_m2, step.turn_variance_rad2, step.shared_m_rad
    # the noise moves x by (cos, -dy/2) and y by (sin, dx/2) per unit of travel and of turn
    sx, sy = -dy / 2, dx / 2
    o_oo = (
        oo + drifts_s * ob + turned_rad * og + drifts_s * o_b + turned_rad * o_g + step.offset_variance_rad2
    )
    covariance = (
        x_x - dy * (x_h + xe / 2) + dx * x_s + q_l * cos * cos + 2 * q_lh * cos * sx + q_h * sx * sx,
        x_y + dx * (x_h + xe / 2) + dy * x_s + q_l * cos * sin + q_lh * (cos * sy + sin * sx) + q_h * sx * sy,
        x_h + xe + q_lh * cos + q_h * sx,
        x_o + drifts_s * x_b + turned_rad * x_g,
        x_b, x_s, x_t, x_m, x_g,
        y_y + dx * (y_h + ye / 2) + dy * y_s + q_l * sin * sin + 2 * q_lh * sin * sy + q_h * sy * sy,
        y_h + ye + q_lh * sin + q_h * sy,
        y_o + drifts_s * y_b + turned_rad * y_g,
        y_b, y_s, y_t, y_m, y_g,
        h_h + he + q_h,
        h_o + drifts_s * h_b + turned_rad * h_g,
        h_b, h_s, h_t, h_m, h_g,
        o_oo,
        o_b, o_s, o_t, o_m, o_g,
        bb + step.bias_variance_rad2_s2,
        bs, bt, bm, bg,
    )  # fmt: skip
    x_m, y_m, heading_rad = state.x_m + dx, state.y_m + dy, state.heading_rad + turned_rad
    climb_m = state.climb_m + step.climb_m
    offset_rad = state.offset_rad + drifts_s * state.bias_rad_s
    return MotionEstimate(x_m, y_m, heading_rad, offset_rad, state.bias_rad_s, climb_m, covariance)


def surprise(state: MotionEstimate, imu_heading_rad: float, variance_rad2: float) -> tuple[float, float]:
    """How far a heading of the IMU is from the expected one, whole turns apart, and the variance of that."""
    c = state.covariance
    off_rad = math.remainder(imu_heading_rad - state.heading_rad - state.offset_rad, math.tau)
    return off_rad, c[17] + 2 * c[18] + c[24] + variance_rad2


def with_imu_heading(state: MotionEstimate, imu_heading_rad: float, variance_rad2: float) -> MotionEstimate:
    """The state corrected by a heading of the IMU, which measures heading + offset."""
    off_rad, variance = surprise(state, imu_heading_rad, variance_rad2)
    c = state.covariance
    gains = (
        c[2] + c[3], c[10] + c[11], c[17] + c[18], c[18] + c[24], c[19] + c[25],
        c[20] + c[26], c[21] + c[27], c[22] + c[28], c[23] + c[29],
    )  # fmt: skip
    return _correct(state, gains, off_rad, variance)


def with_bias(state: MotionEstimate, bias_rad_s: float, variance_rad2_s2: float) -> MotionEstimate:
    """The state corrected by a measurement of the bias."""
    c = state.covariance
    gains = (c[4], c[12], c[19], c[25], c[30], c[31], c[32], c[33], c[34])
    return _correct(state, gains, bias_rad_s - state.bias_rad_s, c[30] + variance_rad2_s2)


def _correct(
    state: MotionEstimate, to_measured: tuple[float, ...], off: float, variance: float
) -> MotionEstimate:
    """The state after a measurement; ``to_measured`` is the covariance of each error with what was measured.

    The considered errors keep their variances: that is Schmidt's filter.
    """
    if variance <= 0:
        return state
    px, py, ph, po, pb, ps, pt, pm, pg = to_measured
    kx, ky, kh, ko, kb = px / variance, py / variance, ph / variance, po / variance, pb / variance
    (
        xx, xy, xh, xo, xb, xs, xt, xm, xg,
        yy, yh, yo, yb, ys, yt, ym, yg,
        hh, ho, hb, hs, ht, hm, hg,
        oo, ob, os, ot, om, og,
        bb, bs, bt, bm, bg,
    ) = state.covariance  # fmt: skip
    covariance = (
        xx - kx * px, xy - kx * py, xh - kx * ph, xo - kx * po, xb - kx * pb,
        xs - kx * ps, xt - kx * pt, xm - kx * pm, xg - kx * pg,
        yy - ky * py, yh - ky * ph, yo - ky * po, yb - ky * pb,
        ys - ky * ps, yt - ky * pt, ym - ky * pm, yg - ky * pg,
        hh - kh * ph, ho - kh * po, hb - kh * pb,
        hs - kh * ps, ht - kh * pt, hm - kh * pm, hg - kh * pg,
        oo - ko * po, ob - ko * pb,
        os - ko * ps, ot - ko * pt, om - ko * pm, og - ko * pg,
        bb - kb * pb, bs - kb * ps, bt - kb * pt, bm - kb * pm, bg - kb * pg,
    )  # fmt: skip
    return MotionEstimate(
        state.x_m + kx * off,
        state.y_m + ky * off,
        state.heading_rad + kh * off,
        state.offset_rad + ko * off,
        state.bias_rad_s + kb * off,
        state.climb_m,
        covariance,
    )


def widen(state: MotionEstimate, position_variance_m2: float, heading_variance_rad2: float) -> MotionEstimate:
    """The state, less certain of its position and heading."""
    c = list(state.covariance)
    c[0] += position_variance_m2
    c[9] += position_variance_m2
    c[17] += heading_variance_rad2
    return replace(state, covariance=tuple(c))


def with_unknown_bias(state: MotionEstimate, sigma_rad_s: float) -> MotionEstimate:
    """The state with a bias of 0, of this uncertainty."""
    c = list(state.covariance)
    for index in (4, 12, 19, 25, 31, 32, 33, 34):
        c[index] = 0.0
    c[30] = sigma_rad_s**2
    return replace(state, bias_rad_s=0.0, covariance=tuple(c))


def with_new_turn_errors(state: MotionEstimate) -> MotionEstimate:
    """The state when the turn is measured by another sensor from now on: its errors have had no effect yet."""
    c = list(state.covariance)
    for index in (6, 7, 14, 15, 21, 22, 27, 28, 32, 33):
        c[index] = 0.0
    return replace(state, covariance=tuple(c))


def with_new_offset(state: MotionEstimate, imu_heading_rad: float, variance_rad2: float) -> MotionEstimate:
    """The state in which the IMU's heading has begun anew here: the offset is known as well as heading and reading are.

    ``offset = reading - heading``, so its error is that of the reading less that of the heading.
    """
    c = list(state.covariance)
    c[3], c[11], c[18] = -c[2], -c[10], -c[17]
    c[24] = c[17] + variance_rad2
    c[25] = -c[19]
    c[26], c[27], c[28], c[29] = -c[20], -c[21], -c[22], -c[23]
    return replace(state, offset_rad=imu_heading_rad - state.heading_rad, covariance=tuple(c))


def at_pose(state: MotionEstimate, pose: Pose2D) -> MotionEstimate:
    """The state at a declared pose, which is certain; the IMU's heading stays where it is, and so do the biases."""
    c = state.covariance
    covariance = (
        *(0.0,) * 24,
        c[17] + 2 * c[18] + c[24], c[19] + c[25], c[20] + c[26], c[21] + c[27], c[22] + c[28], c[23] + c[29],
        *c[30:],
    )  # fmt: skip
    offset_rad = state.heading_rad + state.offset_rad - pose.heading_rad
    return MotionEstimate(pose.x_m, pose.y_m, pose.heading_rad, offset_rad, state.bias_rad_s, 0.0, covariance)
