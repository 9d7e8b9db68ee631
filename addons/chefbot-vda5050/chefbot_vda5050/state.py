"""The state that a robot reports, from what is left of its order and what is known of the robot."""

from typing import Any, Final

from chefbot_vda5050.actions import Tracked
from chefbot_vda5050.messages import (
    ActionState,
    BatteryState,
    EdgeState,
    EStop,
    Info,
    InfoLevel,
    NodeState,
    Position,
    SafetyState,
    State,
    Velocity,
    Visualization,
)
from chefbot_vda5050.paths import intermediate_path, planned_path
from chefbot_vda5050.problems import LONGEST_TEXT, Problem, Reason
from chefbot_vda5050.vehicle import Facts, Limits, Vehicle

STANDING_M_S, STANDING_RAD_S = 0.005, 0.01
"""Slower is standing: encoders and IMU are never quite still."""

UNKNOWN_CHARGE_PERCENT: Final = 80.0
"""The standard wants a number; this is its own for a battery that is good and not measured (6.10.6)."""


def is_driving(facts: Facts) -> bool:
    """Whether the robot drives or turns."""
    return abs(facts.linear_m_s) > STANDING_M_S or abs(facts.angular_rad_s) > STANDING_RAD_S


def state(vehicle: Vehicle, facts: Facts, header: dict[str, Any], limits: Limits) -> State:
    """The message of the topic ``state``."""
    version: str = header["version"]
    of_order = [one for one in vehicle.actions if one.sequence_id is not None]
    instant = [one for one in vehicle.actions if one.sequence_id is None]
    charge = UNKNOWN_CHARGE_PERCENT if facts.charge_percent is None else facts.charge_percent
    return State(
        **header,
        order_id=vehicle.order_id,
        order_update_id=vehicle.order_update_id,
        last_node_id=vehicle.last_node_id,
        last_node_sequence_id=vehicle.last_node_sequence_id,
        driving=is_driving(facts),
        paused=vehicle.paused or facts.paused,
        new_base_request=vehicle.needs_base(),
        operating_mode=facts.mode,
        node_states=tuple(
            NodeState(node_id=node.node_id, sequence_id=node.sequence_id, released=node.released)
            for node in vehicle.nodes
        ),
        edge_states=tuple(
            EdgeState(edge_id=edge.edge_id, sequence_id=edge.sequence_id, released=edge.released)
            for edge in vehicle.edges
        ),
        action_states=tuple(_action_state(one) for one in of_order),
        instant_action_states=tuple(_action_state(one) for one in instant),
        planned_path=planned_path(facts),
        intermediate_path=intermediate_path(facts, header["timestamp"], limits),
        agv_position=position(facts),
        velocity=Velocity(vx=facts.linear_m_s, vy=0.0, omega=facts.angular_rad_s),
        loads=vehicle.loads,
        battery_state=BatteryState(battery_charge=charge, charging=False, battery_voltage=facts.voltage_v),
        errors=tuple(one.error(version) for one in (*vehicle.problems, *robot_problems(facts))),
        information=information(facts),
        safety_state=SafetyState(e_stop=facts.e_stop, field_violation=facts.held_back),
    )


def visualization(facts: Facts, header: dict[str, Any], limits: Limits, state_id: int) -> Visualization:
    """The message of the topic ``visualization``; ``state_id`` is the headerId of the latest state."""
    velocity = Velocity(vx=facts.linear_m_s, vy=0.0, omega=facts.angular_rad_s)
    return Visualization(
        **header,
        agv_position=position(facts),
        velocity=velocity,
        reference_state_header_id=state_id,
        planned_path=planned_path(facts),
        intermediate_path=intermediate_path(facts, header["timestamp"], limits),
    )


def position(facts: Facts) -> Position | None:
    """Where the robot is; None without a map."""
    if not facts.map_id:
        return None
    return Position(
        x=facts.x_m,
        y=facts.y_m,
        theta=facts.heading_rad,
        map_id=facts.map_id,
        position_initialized=facts.localized,
        localization_score=None if facts.fit is None else min(1.0, max(0.0, facts.fit)),
    )


def robot_problems(facts: Facts) -> tuple[Problem, ...]:
    """What is wrong with the robot itself, whatever its order is."""
    found = []
    if not facts.connected:
        found.append(Problem(Reason.UNREACHABLE, facts.missing or "the robot's daemon cannot be reached"))
    elif facts.e_stop is not EStop.NONE:
        found.append(Problem(Reason.EMERGENCY_STOP, facts.missing or "the robot is stopped"))
    elif not facts.armed:
        found.append(Problem(Reason.DISARMED, facts.missing or "the robot is disarmed"))
    if facts.fault:
        found.append(Problem(Reason.FAULT, facts.fault))
    if facts.connected and not facts.localized:
        found.append(Problem(Reason.NOT_LOCALIZED, "the robot does not know where it is"))
    return tuple(found)


def information(facts: Facts) -> tuple[Info, ...]:
    """What people may like to know; managers decide nothing by it (6.10.4)."""
    if facts.charge_percent is not None:
        return ()
    text = f"the charge is not measured; {UNKNOWN_CHARGE_PERCENT:g} % stands for a good battery"
    return (Info(info_type="batteryUnknown", info_level=InfoLevel.INFO, info_description=text),)


def _action_state(one: Tracked) -> ActionState:
    return ActionState(
        action_id=one.action.action_id,
        action_type=one.action.action_type,
        action_description=(one.action.action_description or "")[:LONGEST_TEXT] or None,
        action_status=one.status,
        result_description=one.result,
    )
