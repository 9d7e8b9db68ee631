"""Asks for a robot from its board to its outline; every answer is one value of its configuration."""

import math
from collections.abc import Callable, Collection, Mapping

from chefbotd.components.new_robot.answers import LIDAR, Answers, FoundValue
from chefbotd.components.new_robot.board import CLASSIC, Found, Serial, find_board
from chefbotd.components.new_robot.interview import Interview
from chefbotd.components.new_robot.measuring import Connect, by_duty, draft
from chefbotd.components.new_robot.wheels_by_hand import FoundMotors, run_motors, turn_on_floor, turn_wheels
from chefbotd.motion.drive_state import LOADED_SHARE
from chefbotd.settings import Settings, load, packaged
from chefbotd.settings.values import value_of

MOST_CM = 300.0
RADIUS, TRACK = "chassis.wheels radius_m", "chassis.track_width_m"
SAME_BY_HAND, SAME_MOTORS = 0.005, 0.02
"""What a second measurement may differ by, as a share, and change nothing."""

HIGHEST_SPEED_SHARE = 2.0
"""``max_speed_rad_s`` over the free speed of the wheels, as ChefBot's 16.8 over 8.4: faster is a damaged line."""

ACCELERATION_PER_S = 6.0
"""``max_acceleration_rad_s2`` over the free speed, as ChefBot's 50 over 8.4."""


class Walk:
    """One run. ``answers`` has what is known so far, also when it is interrupted; ``missing`` what was skipped."""

    def __init__(
        self,
        interview: Interview,
        serial: Serial,
        connect: Connect,
        present: Settings | None,
        base: str | None,
        unmeasured: Collection[str] = (),
    ) -> None:
        """Ask with ``present``'s values as defaults, but for those that its file calls ``unmeasured``."""
        self._interview, self._serial, self._connect = interview, serial, connect
        self._present, self._wanted_base, self._unmeasured = present, base, unmeasured
        self.base = base or CLASSIC
        self.answers: dict[str, FoundValue] = {}
        self.missing: list[str] = []

    async def walk(self, device: str | None) -> Answers:
        """Ask everything."""
        board = await find_board(self._interview, self._serial, device)
        self.base = self._wanted_base or board.base
        self.answers |= {
            section: FoundValue(False, "the board sends no line of it") for section in self._absent(board)
        }
        self.answers |= board.answers
        await self._ask_name()
        radius_m = await self._ask_radius()
        tape_m = await self._ask_tape()
        if board.link is not None:
            await self._measure(board, radius_m, tape_m)
        else:
            self.missing += ["encoders.counts_per_turn", "drive.max_rim_speed_m_s and the gains"]
        await self._ask_sensors(board)
        await self._ask_outline()
        return self.answers

    @property
    def _usual(self) -> Settings:
        """The robot as its file has it; a new one as the packaged robot is."""
        return self._present or load(packaged(self.base))

    def _is_known(self, key: str) -> bool:
        """Whether the file has this robot's own value: Enter may keep it."""
        return self._present is not None and key not in self._unmeasured

    def _absent(self, board: Found) -> list[str]:
        usual = self._usual
        return [section for section in board.absent if getattr(usual, section)]

    async def _ask_name(self) -> None:
        default = self._present.robot.name if self._present else "my_robot"
        name = await self._interview.text("What is the robot's name?", default)
        self.answers["robot.name"] = FoundValue(name, "")

    async def _ask_radius(self) -> float:
        usual_m = self._usual.chassis.wheels[0].radius_m
        rolled_cm = await self._interview.number(
            "Mark a tyre where it touches the floor, and the floor. Roll the robot straight ahead by one turn of the "
            "wheel: how far did it go, by tape?",
            "cm", 1, MOST_CM, round(math.tau * usual_m * 100, 2) if self._is_known(RADIUS) else None,
        )  # fmt: skip
        if rolled_cm is None:
            self.missing.append(RADIUS)
            return usual_m
        radius_m = round(rolled_cm / 100 / math.tau, 5)
        for wheel in self._usual.chassis.wheels:
            kept = self._present is not None and abs(wheel.radius_m - radius_m) < 2e-5
            self.answers[f"chassis.wheels.{wheel.name}.radius_m"] = FoundValue(
                wheel.radius_m if kept else radius_m, f"{rolled_cm:g} cm a turn, by tape"
            )
        return radius_m

    async def _ask_tape(self) -> float | None:
        usual_cm = round(self._usual.chassis.track_width_m * 100, 2) if self._is_known(TRACK) else None
        track_cm = await self._interview.number(
            "How far apart are the left and the right wheels, from the middle of a tyre to the middle of the other?",
            "cm", 1, MOST_CM, usual_cm,
        )  # fmt: skip
        if track_cm is None:
            return None
        self.answers["chassis.track_width_m"] = FoundValue(round(track_cm / 100, 4), "by tape")
        return track_cm / 100

    async def _measure(self, board: Found, radius_m: float, tape_m: float | None) -> None:
        """Counts by hand, motors on blocks, and the track on the floor."""
        wheels = self._usual.chassis.wheels
        names = [wheel.name for wheel in wheels]
        overrides = self._overrides(board, radius_m, dict.fromkeys(names, 1), dict.fromkeys(names, 1))
        async with self._connect(draft(self.base, overrides, None)) as robot:
            turned = await turn_wheels(self._interview, robot, names)
        if turned is None:
            self._interview.say(
                "Without counts nothing else is measured. Do not drive before: 'chefbotctl calibrate encoders'."
            )
            self.missing += ["encoders.counts_per_turn", "drive.max_rim_speed_m_s and the gains"]
            return
        counts = turned.counts_per_turn
        counts = self._same("encoders.counts_per_turn", counts, SAME_BY_HAND)
        self.answers["encoders.counts_per_turn"] = FoundValue(counts, "by turns of the wheels by hand")
        self._add_signs("encoder_sign", turned.signs)
        overrides = self._overrides(board, radius_m, turned.signs, dict.fromkeys(names, 1))
        async with self._connect(by_duty(self.base, overrides, counts)) as robot:
            motors = await run_motors(self._interview, robot, names, radius_m)
        if motors is None:
            self.missing.append("drive.max_rim_speed_m_s and the gains")
        else:
            self._add_motors(motors)
        async with self._connect(draft(self.base, overrides, counts)) as robot:
            sides = {wheel.name: wheel.side for wheel in wheels}
            track_m = await turn_on_floor(self._interview, robot, sides, radius_m, counts, tape_m)
        if track_m is not None:
            self._add_track(track_m, tape_m)
        elif tape_m is None:
            self.missing.append(TRACK)

    def _overrides(
        self, board: Found, radius_m: float, encoder_signs: Mapping[str, int], motor_signs: Mapping[str, int]
    ) -> dict[str, object]:
        """What a daemon that measures has to know."""
        link = {} if board.link is None else {"link.device": board.link.device, "link.baud": board.link.baud}
        wheels = [
            {
                "name": wheel.name,
                "side": wheel.side.value,
                "radius_m": radius_m,
                "encoder_sign": encoder_signs[wheel.name],
                "motor_sign": motor_signs[wheel.name],
            }
            for wheel in self._usual.chassis.wheels
        ]
        counted_by = "firmware" if board.heard.firmware else "sketch"
        return {
            **link,
            "robot.wire": board.heard.wire,
            "encoders.counted_by": counted_by,
            "chassis.wheels": wheels,
        }

    def _add_signs(self, key: str, signs: Mapping[str, int]) -> None:
        reason = "as it was turned by hand" if key == "encoder_sign" else "as its motor turned it"
        for name, sign in signs.items():
            self.answers[f"chassis.wheels.{name}.{key}"] = FoundValue(sign, reason)

    def _same(self, key: str, measured: float, share: float) -> float:
        """The file's value where the measured one is the same but for this share; else the measured one."""
        present = None if self._present is None else value_of(self._present, key)
        return measured if present is None or abs(measured - present) > share * abs(present) else present

    def _add_motors(self, motors: FoundMotors) -> None:
        """The speed under load, and gains in the packaged robot's proportion to the duty per speed."""
        figures, base = motors.figures, load(packaged(self.base)).pid
        scale = figures.kv_duty_per_m_s / base.kv
        free = f"{figures.free_m_s:.3f} m/s free at full duty"
        self._add_signs("motor_sign", motors.signs)
        top = f"twice the {figures.free_rad_s:.1f} rad/s at full duty"
        measured = {
            "encoders.max_speed_rad_s": (HIGHEST_SPEED_SHARE * figures.free_rad_s, 1, top),
            "encoders.max_acceleration_rad_s2": (
                ACCELERATION_PER_S * figures.free_rad_s, 1, "assumed: six times the same, as ChefBot's",
            ),
            "drive.max_rim_speed_m_s": (LOADED_SHARE * figures.free_m_s, 3, f"{free}, less a tenth under load"),
            "pid.ks_duty": (figures.ks_duty, 1, "duty that overcomes friction,"),
            "pid.kv_duty_per_m_s": (figures.kv_duty_per_m_s, 1, "and duty per speed, by both speeds"),
            "pid.ka_duty_per_m_s2": (base.ka * scale, 1, "in proportion to kv, as the next two"),
            "pid.kp_duty_per_m_s": (base.kp * scale, 1, ""),
            "pid.ki_duty_per_m": (base.ki * scale, 1, ""),
        }  # fmt: skip
        for key, (value, digits, reason) in measured.items():
            self.answers[key] = FoundValue(self._same(key, round(value, digits), SAME_MOTORS), reason)

    def _add_track(self, track_m: float, tape_m: float | None) -> None:
        """Of two wheels it is the track; more of them skid, and the tape's track keeps a multiplier."""
        if len(self._usual.chassis.wheels) > 2 and tape_m is not None:
            multiplier = self._same("chassis.track_multiplier", round(track_m / tape_m, 3), SAME_BY_HAND)
            self.answers["chassis.track_multiplier"] = FoundValue(
                multiplier, "by turns on the floor: wheels that skid"
            )
        else:
            track_m = self._same("chassis.track_width_m", round(track_m, 4), SAME_BY_HAND)
            self.answers["chassis.track_width_m"] = FoundValue(track_m, "by turns on the floor")

    async def _ask_sensors(self, board: Found) -> None:
        """Each sensor of which lines come: where it is, or that there is none."""
        sends: Callable[[str], bool] = board.heard.sends
        if board.link is not None and sends("u"):
            await self._ask_ultrasonic()
        if (
            board.link is not None
            and sends("i")
            and not await self._interview.agrees(
                "The board sends lines of an IMU. Is one on the robot?", default=True
            )
        ):
            self.answers["imu"] = FoundValue(False, "there is none")
        if (
            board.link is not None
            and sends("b")
            and not await self._interview.agrees(
                "The board sends the battery's level. Is the battery wired to it by a divider?", default=True
            )
        ):
            self.answers["battery"] = FoundValue(False, "it is not wired")
        for lidar in board.lidars[:1]:
            model = (
                "ld19" if lidar.kind == "ld06_ld19" else "rplidar_a2" if "A2" in lidar.told else "rplidar_a1"
            )
            ahead_cm = await self._interview.number(
                f"{lidar.device} is {lidar.told}. How far is its middle ahead of the axle between the driven wheels "
                "(negative: behind)?", "cm", -MOST_CM, MOST_CM, 0.0,
            )  # fmt: skip
            self.answers[f"{LIDAR}.model"] = FoundValue(model, lidar.told)
            self.answers[f"{LIDAR}.device"] = FoundValue(
                lidar.device, "better its name in /dev/serial/by-id/"
            )
            self.answers[f"{LIDAR}.mount_x_m"] = FoundValue(
                round((ahead_cm or 0.0) / 100, 4), "ahead of the axle"
            )

    async def _ask_ultrasonic(self) -> None:
        if not await self._interview.agrees(
            "The board sends readings of an ultrasonic sensor. Is one on the robot?", default=True
        ):
            self.answers["ultrasonic"] = FoundValue(False, "there is none")
            return
        usual = self._usual.ultrasonic
        ahead_cm = await self._interview.number(
            "How far is it ahead of the axle between the driven wheels?", "cm", -MOST_CM, MOST_CM,
            None if usual is None else round(usual.mount_x_m * 100, 2),
        )  # fmt: skip
        if ahead_cm is not None:
            self.answers["ultrasonic.mount_x_m"] = FoundValue(round(ahead_cm / 100, 4), "ahead of the axle")

    async def _ask_outline(self) -> None:
        """Length, width and height; without them there is no body, and never ChefBot's."""
        body = self._present.body if self._present else None
        usual = {
            "length": None if body is None else body.length_m,
            "width": None if body is None else body.width_m,
            "height": None if body is None else body.height_m,
        }
        sizes_m: dict[str, float] = {}
        for side, usual_m in usual.items():
            size_cm = await self._interview.number(
                f"The robot's {side}, with all that sticks out (an obstacle guard with a lidar keeps this clear)",
                "cm", 1, 500, None if usual_m is None else round(usual_m * 100, 2),
            )  # fmt: skip
            if size_cm is None:
                if body is None:
                    self.leave_out_body()
                return
            sizes_m[side] = round(size_cm / 100, 4)
        for side, size_m in sizes_m.items():
            self.answers[f"body.{side}_m"] = FoundValue(size_m, "with all that sticks out")

    def leave_out_body(self) -> None:
        """Nobody measured the outline: it is never the packaged robot's."""
        self.answers["body"] = FoundValue(False, "not measured: the box about the wheels is the outline")

    def leave_out_unasked(self) -> None:
        """End early: what was not asked counts as not measured."""
        tracks, radii = {TRACK, "chassis.track_multiplier"}, "chassis.wheels."
        if not any(key.startswith(radii) and key.endswith("radius_m") for key in self.answers):
            self.missing.append(RADIUS)
        if not tracks & self.answers.keys():
            self.missing.append(TRACK)
        if not any(key.startswith("body.") for key in self.answers):
            self.leave_out_body()
        self.missing = list(dict.fromkeys(self.missing))
