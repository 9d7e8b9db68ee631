"""The simulated robot in three dimensions, by MuJoCo: it leans, climbs bumps and ramps, and slips as friction has it.

Motors, battery and their flaws are those of ``plant.py``. Everything from the axle on is MuJoCo's.
"""

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from chefbotd.components.simulation.chassis import Chassis
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.ground import Slip
from chefbotd.components.simulation.mujoco_model import FAR_M, NAMES, SPARE_DISCS, model_of
from chefbotd.components.simulation.parameters.floor import FloorParameters
from chefbotd.components.simulation.parameters.motor import GRAVITY_M_S2, MotorParameters, SimBodyParameters
from chefbotd.components.simulation.planar import free_at
from chefbotd.components.simulation.plant import Plant, WheelState
from chefbotd.components.simulation.robot import Robot, RobotState
from chefbotd.components.simulation.scene import Scene
from chefbotd.components.simulation.sensors import Battery, Tilt
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, wrap_angle

LONGEST_STEP_S = 0.005
SETTLING_S = 0.5
STANDS_RAD_S = 0.005
"""A slower wheel has static friction."""

LEAST_INERTIA_SHARE = 0.1
"""What a time constant's factor leaves of a rotor's inertia."""


class MujocoRobot(Robot):
    """A body on wheels among walls and discs. A side's slip takes a share of its grip, not of its travel."""

    def __init__(
        self,
        plant: Plant,
        motor: MotorParameters,
        body: SimBodyParameters,
        chassis: Chassis,
        scene: Scene,
        floor: Sequence[FloorParameters],
        battery: Battery,
        start: Pose2D,
        slip: Slip,
        crowd: Crowd,
    ) -> None:
        """Raises ``ValueError`` when the start pose is closer to a wall than the robot's radius."""
        free_at(start, scene.below(body.height_m), body)
        self._substeps = math.ceil(plant.step_s / LONGEST_STEP_S - 1e-9)
        discs = crowd.discs.tolist()
        text = model_of(motor, body, chassis, scene, floor, start, discs, plant.step_s / self._substeps)
        self._model: Any = mujoco.MjModel.from_xml_string(text)
        self._data: Any = mujoco.MjData(self._model)
        self._find_parts(len(chassis.wheels), len(discs))
        self._is_left = [wheel.is_left for wheel in chassis.wheels]
        self._rotor_kg_m2, self._grip = motor.rotor_inertia_kg_m2, body.grip
        self._discs_placed: Any = None
        idle_v, _ = plant.load(plant.standing, None, battery.supply)
        state = RobotState(start, STANDING, plant.standing, battery, idle_v, math.inf)
        super().__init__(plant, body, state, slip, crowd)
        self._settle(start)

    def _find_parts(self, wheels: int, discs: int) -> None:
        model = self._model
        self._base = model.body(NAMES.base).id
        joints = [model.joint(f"{NAMES.wheel}{number}") for number in range(wheels)]
        self._angles = np.array([joint.qposadr[0] for joint in joints])
        self._speeds = np.array([joint.dofadr[0] for joint in joints])
        self._tyres = np.array([model.geom(f"{NAMES.wheel}{number}").id for number in range(wheels)])
        self._discs = [model.geom(f"{NAMES.disc}{number}").id for number in range(discs + SPARE_DISCS)]
        names = [model.geom(number).name for number in range(model.ngeom)]
        self._solid = np.array([name.startswith((NAMES.solid, NAMES.disc)) for name in names])
        self._is_free = model.nq > wheels

    def _settle(self, start: Pose2D) -> None:
        """Let the robot sink into the floor before time 0, and put it back where it starts."""
        self._set_axles(self._now, 0.0)
        mujoco.mj_step(self._model, self._data, math.ceil(SETTLING_S / self._model.opt.timestep))
        if self._is_free:
            self._data.qpos[:2] = start.x_m, start.y_m
        self._data.qpos[self._angles] = 0.0
        self._data.qvel[:] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def _step(self, state: RobotState) -> RobotState:
        supply, step_s = state.battery.supply, self._plant.step_s
        terminal_v, drawn_a = self._plant.load(state.wheels, self._pulse_width, supply)
        self._set_axles(state, terminal_v)
        self._set_push(state.world_from_base.heading_rad)
        if self._crowd.discs is not self._discs_placed:
            self._place_discs()
        mujoco.mj_step(self._model, self._data, self._substeps)
        data = self._data
        wheels = WheelState(tuple(data.qpos[self._angles].tolist()), tuple(data.qvel[self._speeds].tolist()))
        battery = state.battery.drained(drawn_a, step_s)
        if not self._is_free:
            return RobotState(state.world_from_base, STANDING, wheels, battery, terminal_v, math.inf)
        return self._moved(state, wheels, battery, terminal_v)

    def _set_axles(self, state: RobotState, terminal_v: float) -> None:
        turning = [speed if abs(speed) > STANDS_RAD_S else 0.0 for speed in state.wheels.velocity_rad_s]
        wheels = WheelState(state.wheels.angle_rad, tuple(turning))
        axles = self._plant.axles(wheels, self._pulse_width, terminal_v)
        model, dofs, rotor = self._model, self._speeds, self._rotor_kg_m2
        self._data.qfrc_applied[dofs] = axles.torque_n_m
        model.dof_damping[dofs] = axles.damping_n_m_s
        model.dof_frictionloss[dofs] = axles.dry_n_m
        model.dof_armature[dofs] = [
            max(rotor + more, LEAST_INERTIA_SHARE * rotor) for more in axles.inertia_kg_m2
        ]
        left, right = 1 - self.slip.left, 1 - self.slip.right
        model.geom_friction[self._tyres, 0] = [
            self._grip * (left if is_left else right) for is_left in self._is_left
        ]

    def _set_push(self, heading_rad: float) -> None:
        push, force = self._pushed_now, self._data.xfrc_applied[self._base]
        if push is None:
            force[:] = 0.0
            return
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        force[0] = push.forward_n * cos - push.leftward_n * sin
        force[1] = push.forward_n * sin + push.leftward_n * cos
        force[5] = push.turn_n_m

    def _place_discs(self) -> None:
        """Put people and things where they are; those for which the model has no room stay away."""
        discs = self._discs_placed = self._crowd.discs
        model, half_m = self._model, self._body.height_m
        for number, geom in enumerate(self._discs):
            x_m, y_m, radius_m = discs[number] if number < len(discs) else (FAR_M, FAR_M, 0.25)
            self._data.mocap_pos[number, :2] = x_m, y_m
            if model.geom_size[geom, 0] != radius_m:
                model.geom_size[geom, 0] = radius_m
                model.geom_rbound[geom] = math.hypot(radius_m, half_m)
                model.geom_aabb[geom, 3:5] = radius_m
                model.bvh_aabb[model.body_bvhadr[model.geom_bodyid[geom]], 3:5] = radius_m

    def _moved(
        self, state: RobotState, wheels: WheelState, battery: Battery, terminal_v: float
    ) -> RobotState:
        data, step_s, before = self._data, self._plant.step_s, state.world_from_base
        x_m, y_m, _, *quaternion = data.qpos[:7].tolist()
        (forward, left, up) = _axes(*quaternion)
        heading_rad = math.atan2(forward[1], forward[0])
        *velocity, roll_rad_s, pitch_rad_s, yaw_rad_s = data.qvel[:6].tolist()
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        turned_rad = wrap_angle(heading_rad - before.heading_rad)
        twist = Twist2D(velocity[0] * cos + velocity[1] * sin, turned_rad / step_s)
        felt = data.qacc[:3].tolist()
        felt[2] += GRAVITY_M_S2
        tilt = Tilt(
            math.asin(min(max(-forward[2], -1.0), 1.0)),
            math.atan2(left[2], up[2]),
            (roll_rad_s, pitch_rad_s, yaw_rad_s),
            (_dot(forward, felt), _dot(left, felt), _dot(up, felt)),
        )
        return RobotState(
            Pose2D(x_m, y_m, heading_rad),
            twist,
            wheels,
            battery,
            terminal_v,
            math.inf,
            (twist.linear_m_s - state.twist.linear_m_s) / step_s,
            touches_disc=bool(self._solid[data.contact.geom].any()),
            turned_rad=state.turned_rad + turned_rad,
            tilt=tilt,
        )


Axis = tuple[float, float, float]


def _axes(w: float, x: float, y: float, z: float) -> tuple[Axis, Axis, Axis]:
    """The base's axes (forward, left, up) in the world frame, from its quaternion."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


def _dot(a: Axis, b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
