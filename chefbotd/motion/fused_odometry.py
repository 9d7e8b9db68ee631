"""Odometry by wheels and IMU.

The wheels say how far the robot travels. A gyroscope's rate says how far it turns; without one, the wheels say that as
well, and the IMU's heading corrects it (``heading_fusion``). A robot at rest shows the gyroscope's bias: its wheels
stand, its motors have no duty, and its rates do not vary. Wheels alone are no sign of rest, because a robot can turn
slowly while they stand.

The turns by wheels and IMU are compared all the time (``wheel_slip``). While they differ, the estimate is less certain.
"""

import math
from typing import Final

from chefbotd.core.events.robot import ImuMeasured, ImuTrust, MotionAnomaly, WheelsDriven
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.record import StatefulPart, replace
from chefbotd.motion import motion_filter
from chefbotd.motion.bias_evidence import EVIDENCE_S, NO_EVIDENCE, BiasEvidence, with_evidence
from chefbotd.motion.heading_fusion import FusionState, note_cycle, note_refusal, take_headings
from chefbotd.motion.imu_agreement import ImuAgreement
from chefbotd.motion.imu_track import HeadingTrack, RateTrack
from chefbotd.motion.motion_filter import Considered, MotionEstimate, MotionStep
from chefbotd.motion.odometry import (
    BIAS_WALK_RAD_S_PER_ROOT_S,
    HEADING_WALK_RAD_PER_ROOT_S,
    SLIP_RAD,
    FusionParameters,
)
from chefbotd.motion.wheel_slip import QUIET_S, TurnSample, widened_step

OUTLIER_SHARE: Final = 0.03
LOST_S: Final = 0.5
FROZEN_RAD: Final = 0.2
FROZEN_READINGS: Final = 5
"""The wheels turn the robot so far, and so many readings of the IMU repeat the one before."""

MOST_REPEATS: Final = 2 * FROZEN_READINGS
CHANGE_REPEATS: Final = 2
"""Of the repeats that are counted, a reading that repeats nothing takes so many off: a single one ends nothing."""

REST_S: Final = 0.5
REST_RAD_S: Final = 0.05
"""The bias of an MPU-6050 that has calibrated itself is smaller; a robot that turns faster does not rest."""

LIFTED_COS: Final = math.cos(0.35)
MOST_SPIKES: Final = 5
LEFT_OUT_M2: Final = 0.05**2
"""How uncertain the position is after an IMU was left out that the pose had followed for half a turn; assumed."""

STILL_M: Final = 2e-4
"""Wheels that roll less in a cycle dither by a count or two."""


class FusedOdometry(StatefulPart[FusionState]):
    """Odometry by wheels and IMU, for a robot of this effective track.

    ``travel_variance`` (m²/m) and ``turn_variance`` (rad²/rad) are those of the wheels. ``imu_scale`` and ``imu_lag_s``
    are what its calibration says: what it shows of a turn, and how late. ``is_skid_steer``: its wheels' turn is next to
    no evidence, so it is not compared with the IMU's.
    """

    def __init__(
        self,
        parameters: FusionParameters,
        *,
        track_width_m: float,
        travel_variance: float,
        turn_variance: float,
        imu_scale: float = 1.0,
        imu_lag_s: float = 0.0,
        is_skid_steer: bool = False,
    ) -> None:
        self._parameters, self._track_m = parameters, track_width_m
        self._per_m, self._per_rad = travel_variance, turn_variance
        self._scale, self._lag_s, self._may_slip = imu_scale, imu_lag_s, not is_skid_steer
        size, gyro = parameters.size_sigma**2, parameters.gyro_scale_sigma**2
        per_m = (parameters.ratio_sigma / track_width_m) ** 2
        self._by_wheels = Considered(size, parameters.track_sigma**2, per_m, gyro)
        self._by_gyro = Considered(size, gyro, 0.0, gyro)
        self._limits = SLIP_RAD, 3 * (parameters.track_sigma + parameters.gyro_scale_sigma)
        self.memory = FusionState()

    @property
    def estimate(self) -> MotionEstimate:
        """The filter's state at the last travel of the wheels."""
        return self.memory.estimate

    @property
    def lag_s(self) -> float:
        """By how much more than configured the IMU's headings come late."""
        return self.memory.lag_s

    @property
    def rate_rad_s(self) -> float | None:
        """How fast the robot turns by the gyroscope; None without one."""
        now = self.memory
        if not now.has_rates or now.rates.used_rad is None:
            return None
        return 0.0 if now.resting_s > REST_S else now.rates.rate_rad_s - now.estimate.bias_rad_s

    def move_to(self, pose: Pose2D) -> None:
        """Declare the robot's pose; it becomes certain."""
        self.memory.estimate = motion_filter.at_pose(self.memory.estimate, pose)

    def forget_imu(self) -> None:
        """Begin anew with the IMU: the board has restarted or is gone, so its heading and its queue begin anew."""
        now = self.memory
        now.has_offset, now.lag_s, now.irregular_cycles, now.imu_values = False, 0.0, 0, ()
        now.headings, now.rates, now.unchanged_rad = HeadingTrack(), RateTrack(), 0.0
        now.agreement, now.by_wheels, now.rest_from = ImuAgreement(), None, None
        now.waiting.clear()
        now.readings.clear()
        now.turns.clear()

    @property
    def imu_trust(self) -> ImuTrust:
        """What is made of the IMU."""
        now = self.memory
        if now.stamp_s is None or now.imu_s == -math.inf:
            return ImuTrust.UNUSED
        if now.agreement.fault:
            return ImuTrust.DISAGREES
        if now.stamp_s - now.imu_s > LOST_S:
            return ImuTrust.LOST
        if self._is_frozen:
            return ImuTrust.FROZEN
        if now.irregular_cycles:
            return ImuTrust.LATE
        return ImuTrust.OUTLIERS if now.outlier_share > OUTLIER_SHARE else ImuTrust.OK

    @property
    def _is_frozen(self) -> bool:
        now = self.memory
        return now.imu_repeats >= FROZEN_READINGS and abs(now.unchanged_rad) > FROZEN_RAD

    @property
    def anomaly(self) -> MotionAnomaly:
        """What makes the motion less certain."""
        now, stamp_s = self.memory, self.memory.stamp_s or 0.0
        if now.is_lifted:
            return MotionAnomaly.LIFTED
        if stamp_s - now.turns.push_s < QUIET_S:
            return MotionAnomaly.PUSHED
        if stamp_s - now.turns.slip_s < QUIET_S:
            return MotionAnomaly.SLIP
        return MotionAnomaly.STALLED if now.stall.is_stalled else MotionAnomaly.NONE

    def add_driven(self, event: WheelsDriven) -> None:
        """Add what the wheels were to do."""
        self.memory.stall.add(event.stamp_s, event.velocity_rad_s, event.target_rad_s, event.duty)

    def add_imu(self, event: ImuMeasured) -> None:
        """Add a reading of the IMU; it takes effect with the next travel of the wheels that is not older."""
        now, stamp_s = self.memory, event.stamp_s - self._lag_s
        now.imu_s = event.stamp_s
        if now.agreement.fault:
            return
        rates, orientation = event.angular_velocity_rad_s, event.orientation
        values = (rates or ()) + (orientation or ())
        if values == now.imu_values:
            now.imu_repeats = min(now.imu_repeats + 1, MOST_REPEATS)
        else:
            self._note_change(values, event.heading_rad)
        if rates is not None:
            if not now.has_rates:
                now.has_rates = True
                # what is considered of a turn are the gyroscope's errors from now on, and no longer the wheels'
                now.estimate = motion_filter.with_new_turn_errors(now.estimate)
                now.estimate = motion_filter.with_unknown_bias(now.estimate, self._parameters.gyro_bias_rad_s)
            if not now.rates.add(stamp_s, rates[2]):
                note_refusal(now, refused=True)
        if orientation is not None:
            x, y, z, w = orientation
            now.climb_share = 2 * (x * z - w * y) if self._parameters.project_tilt else 0.0
            now.is_lifted = 1 - 2 * (x * x + y * y) < LIFTED_COS
        if event.heading_rad is not None:
            now.agreement.add_heading(event.heading_rad, orientation)
            self._add_heading(stamp_s, event.heading_rad)

    def _note_change(self, values: tuple[float, ...], heading_rad: float | None) -> None:
        """A reading that repeats nothing: the IMU follows the wheels, unless it has not for long, or by too little."""
        now = self.memory
        now.imu_values, now.imu_repeats = values, max(0, now.imu_repeats - CHANGE_REPEATS)
        last_rad, unchanged_rad = now.agreement.last_rad, abs(now.unchanged_rad)
        shown_rad = math.inf
        if heading_rad is not None and last_rad is not None:
            shown_rad = abs(wrap_angle(heading_rad - last_rad))
        follows = unchanged_rad <= FROZEN_RAD and shown_rad >= unchanged_rad / 2
        if follows or now.imu_repeats < FROZEN_READINGS:
            now.unchanged_rad = 0.0

    def _add_heading(self, stamp_s: float, reading_rad: float) -> None:
        now = self.memory
        expected_rad = reading_rad
        if now.has_offset:
            expected_rad = now.estimate.heading_rad + now.estimate.offset_rad
        elif not now.has_headings and not now.has_rates:
            now.estimate = motion_filter.with_unknown_bias(now.estimate, self._parameters.heading_drift_rad_s)
        now.has_headings = True
        heading = now.headings.add(stamp_s, reading_rad, self._scale, expected_rad)
        if heading is not None and not self._is_frozen:
            now.waiting.append(heading)

    def add_travel(self, stamp_s: float, left_m: float, right_m: float) -> MotionEstimate:
        """The estimate at ``stamp_s``, up to which both sides have rolled so far since the last call."""
        now, parameters = self.memory, self._parameters
        dt_s = 0.0 if now.stamp_s is None else max(stamp_s - now.stamp_s, 0.0)
        now.stamp_s = stamp_s
        if parameters.max_acceleration_m_s2 is not None and dt_s > 0:
            left_m, right_m = self._without_spike(left_m, right_m, dt_s, parameters.max_acceleration_m_s2)
        note_cycle(now, dt_s)
        now.reach_rad += 2 * max(abs(left_m), abs(right_m)) / self._track_m
        by_gyro_rad = now.rates.turned_until(stamp_s) if now.has_rates and dt_s > 0 else None
        if by_gyro_rad is None or now.irregular_cycles or self._is_frozen:
            step = self._step_by_wheels(left_m, right_m, dt_s)
        else:
            step = self._step_by_gyro(left_m, right_m, by_gyro_rad, dt_s)
        by_wheels_rad = (right_m - left_m) / self._track_m
        now.unchanged_rad += by_wheels_rad
        if now.imu_s > -math.inf and not now.agreement.fault:
            self._check_imu(stamp_s, (left_m + right_m) / 2, by_wheels_rad, by_gyro_rad)
        if self.anomaly is not MotionAnomaly.NONE:
            step = widened_step(step, self.anomaly)
        if now.climb_share:
            level = math.sqrt(max(1 - now.climb_share**2, 0.0))
            step = replace(step, travel_m=step.travel_m * level, climb_m=step.travel_m * now.climb_share)
        considered = self._by_gyro if now.has_rates else self._by_wheels
        now.estimate = motion_filter.predict(now.estimate, considered, step)
        now.history.add(stamp_s, by_wheels_rad, step.turned_rad, step.turn_variance_rad2)
        if now.waiting:
            take_headings(now, parameters.heading_noise_rad, self._limits, may_slip=self._may_slip)
        return now.estimate

    def _check_imu(
        self, stamp_s: float, travel_m: float, by_wheels_rad: float, by_gyro_rad: float | None
    ) -> None:
        """Compare the IMU's turns with the wheels'; leave one out that disagrees, with what it has done to the pose."""
        now, agreement = self.memory, self.memory.agreement
        if by_gyro_rad is not None:
            agreement.add_rate(by_gyro_rad)
        if now.by_wheels is None:
            now.by_wheels = now.estimate.odom_from_base
        before = now.by_wheels
        middle_rad = before.heading_rad + by_wheels_rad / 2
        now.by_wheels = Pose2D(
            before.x_m + travel_m * math.cos(middle_rad),
            before.y_m + travel_m * math.sin(middle_rad),
            before.heading_rad + by_wheels_rad,
        )
        if now.irregular_cycles or now.stall.is_stalled:
            agreement.forget_turn()
        elif agreement.add_wheels(stamp_s, by_wheels_rad):
            now.by_wheels = None
        agreement.fault = agreement.judge(wheels_slip=not self._may_slip)
        if agreement.fault:
            self._leave_out_imu(now.by_wheels or now.estimate.odom_from_base)

    def _leave_out_imu(self, by_wheels: Pose2D) -> None:
        """Go on by the wheels alone, from the pose that they alone have led to."""
        now = self.memory
        agreement, by_wheels_rad = now.agreement, self._parameters.track_sigma
        self.forget_imu()
        now.agreement, now.has_rates, now.has_headings = agreement, False, False
        now.is_lifted, now.climb_share = False, 0.0
        now.estimate = motion_filter.at_pose(now.estimate, by_wheels)
        now.estimate = motion_filter.with_new_turn_errors(now.estimate)
        now.estimate = motion_filter.widen(now.estimate, LEFT_OUT_M2, (math.pi * by_wheels_rad) ** 2)

    @property
    def imu_reason(self) -> str:
        """Why the IMU is left out; empty where it is not."""
        return self.memory.agreement.reason()

    def _without_spike(
        self, left_m: float, right_m: float, dt_s: float, most_m_s2: float
    ) -> tuple[float, float]:
        """The travel, or that of the last speed where it needs an impossible acceleration."""
        now, (left_m_s, right_m_s) = self.memory, self.memory.sides_m_s
        change_m_s = max(abs(left_m / dt_s - left_m_s), abs(right_m / dt_s - right_m_s))
        if change_m_s > most_m_s2 * dt_s * (now.spikes + 1) and now.spikes < MOST_SPIKES:
            now.spikes += 1
            return left_m_s * dt_s, right_m_s * dt_s
        now.spikes, now.sides_m_s = 0, (left_m / dt_s, right_m / dt_s)
        return left_m, right_m

    def _step_by_wheels(self, left_m: float, right_m: float, dt_s: float) -> MotionStep:
        parameters, track_m, now = self._parameters, self._track_m, self.memory
        if not now.has_rates:
            stands = abs(left_m) < STILL_M and abs(right_m) < STILL_M and now.stall.is_unpowered
            now.resting_s = now.resting_s + dt_s if stands else 0.0
            now.drifted_rad += now.estimate.bias_rad_s * dt_s
            if not stands:
                now.rest_from = None
        left_m2, right_m2 = self._per_m * abs(left_m), self._per_m * abs(right_m)
        turned_rad = (right_m - left_m) / track_m
        turned_rad2 = (left_m2 + right_m2) / track_m**2 + self._per_rad * abs(turned_rad)
        if self.memory.has_rates:  # then what is considered are the gyroscope's errors
            turned_rad2 += (parameters.track_sigma * turned_rad) ** 2
        return MotionStep(
            (left_m + right_m) / 2,
            turned_rad,
            dt_s,
            (left_m2 + right_m2) / 4,
            turned_rad2,
            (right_m2 - left_m2) / (2 * track_m),
            HEADING_WALK_RAD_PER_ROOT_S**2 * dt_s,
            BIAS_WALK_RAD_S_PER_ROOT_S**2 * dt_s,
            bias_turns=False,
        )

    def _step_by_gyro(self, left_m: float, right_m: float, by_gyro_rad: float, dt_s: float) -> MotionStep:
        """The step whose turn is the gyroscope's; at rest the gyroscope shows its bias, and the robot does not turn."""
        now, parameters = self.memory, self._parameters
        noise = parameters.gyro_noise_rad_per_root_s**2
        stands = left_m == 0 == right_m and now.stall.is_unpowered and now.rates.is_still
        rate_rad_s = by_gyro_rad / dt_s - now.estimate.bias_rad_s
        now.resting_s = now.resting_s + dt_s if stands and abs(rate_rad_s) < REST_RAD_S else 0.0
        turned_rad, turned_rad2 = rate_rad_s * dt_s, noise * dt_s
        if now.resting_s > REST_S:
            now.estimate = motion_filter.with_bias(now.estimate, by_gyro_rad / dt_s, noise / dt_s)
            turned_rad = turned_rad2 = 0.0
        if self._may_slip:
            seen = BiasEvidence(by_gyro_rad, (right_m - left_m) / self._track_m, (left_m + right_m) / 2, dt_s)
            self._add_evidence(seen)
        if now.history.turns:
            stamp_s, by_wheels_rad, used_rad, _ = now.history.turns[-1]
            by_wheels_rad += (right_m - left_m) / self._track_m
            sample = TurnSample(stamp_s + dt_s, used_rad + turned_rad, by_wheels_rad, now.reach_rad)
            now.turns.add(sample, *self._limits, may_slip=self._may_slip)
        return MotionStep(
            (left_m + right_m) / 2,
            turned_rad,
            dt_s,
            self._per_m * (abs(left_m) + abs(right_m)) / 4,
            turned_rad2,
            0.0,
            HEADING_WALK_RAD_PER_ROOT_S**2 * dt_s,
            BIAS_WALK_RAD_S_PER_ROOT_S**2 * dt_s,
            bias_turns=now.resting_s <= REST_S,
        )

    def _add_evidence(self, seen: BiasEvidence) -> None:
        """Learn the bias from the wheels, second by second, where they do not slip."""
        now = self.memory
        if self.anomaly is not MotionAnomaly.NONE:
            now.evidence = NO_EVIDENCE
            return
        now.evidence = now.evidence.joined(seen)
        if now.evidence.lasted_s >= EVIDENCE_S:
            variances = self._per_m / self._track_m**2, self._per_rad
            now.estimate = with_evidence(now.estimate, now.evidence, self._by_wheels, variances)
            now.evidence = NO_EVIDENCE
