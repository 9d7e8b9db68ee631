"""The factsheet (6.15): what this robot is and can do, from its configuration; what is not known is said to be 0."""

from typing import Any, Final

from chefbot_vda5050.acceptance import MOST_NODES
from chefbot_vda5050.actions import ACTIONS, UNUSED
from chefbot_vda5050.messages import LONGEST_ID, LONGEST_MESSAGE, Factsheet
from chefbot_vda5050.vehicle import LEAST_SPEED_M_S
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.settings import Settings

SUPPORTED: Final = (
    ("order.nodes.nodePosition", "REQUIRED", "it drives by coordinates"),
    ("order.nodes.nodePosition.theta", "SUPPORTED", "without it any heading will do"),
    ("order.nodes.nodePosition.allowedDeviationXY", "SUPPORTED", "at the start, and where a node is passed"),
    ("order.nodes.nodePosition.allowedDeviationTheta", "SUPPORTED", "at the start"),
    ("order.edges.maxSpeed", "SUPPORTED", f"from {LEAST_SPEED_M_S:g} m/s on"),
    ("order.edges.maxRotationSpeed", "SUPPORTED", "not below the robot's own: lower ones are refused"),
    ("order.edges.maxHeight", "SUPPORTED", "not below the robot's own: lower ones are refused"),
    ("order.edges.length", "SUPPORTED", "it changes nothing"),
)

STATE_INTERVAL_S: Final = 30.0


def factsheet(
    settings: Settings | None, header: dict[str, Any], *, carries_kg: float, seconds: float
) -> Factsheet:
    """The message; without ``settings`` the robot's measures are not known. ``seconds`` between visualizations."""
    return Factsheet(
        **header,
        type_specification=_type(settings, carries_kg),
        physical_parameters=physical(settings),
        protocol_limits={
            "maxStringLens": {"msgLen": LONGEST_MESSAGE, "idLen": LONGEST_ID},
            "maxArrayLens": {"order.nodes": MOST_NODES, "order.edges": MOST_NODES - 1},
            "timing": {
                "minOrderInterval": 0.0,
                "minStateInterval": 0.1,
                "defaultStateInterval": STATE_INTERVAL_S,
                "visualizationInterval": seconds,
            },
        },
        protocol_features={
            "optionalParameters": [
                {"parameter": name, "support": support, "description": description}
                for name, support, description in SUPPORTED
            ],
            "agvActions": [_action(name) for name in ACTIONS],
        },
        agv_geometry=_geometry(settings),
        load_specification={"loadPositions": ["top"], "loadSets": []},
    )


def _type(settings: Settings | None, carries_kg: float) -> dict[str, Any]:
    return {
        "seriesName": settings.robot.name if settings else "chefbot",
        "seriesDescription": "a service robot that drives freely on its own map",
        "agvKinematic": "DIFF",
        "agvClass": "CARRIER",
        "maxLoadMass": carries_kg,
        "localizationTypes": ["NATURAL"],
        "navigationTypes": ["AUTONOMOUS"],
        "supportedZones": [],
    }


def physical(settings: Settings | None) -> dict[str, float]:
    """What the robot measures and how fast it is; 0: not known."""
    names = ("speedMin", "speedMax", "accelerationMax", "decelerationMax", "heightMin", "heightMax")
    values = dict.fromkeys((*names, "width", "length"), 0.0)
    if settings is None:
        return values
    linear, body = settings.limits.linear, settings.body
    own_m_s = min(linear.max_forward_m_s, settings.drive.max_rim_speed_m_s)
    values["speedMin"] = LEAST_SPEED_M_S
    values["speedMax"] = min(own_m_s, settings.of("navigation", NavigationSection).max_speed_m_s)
    values["accelerationMax"] = values["decelerationMax"] = linear.acceleration_m_s2
    if body is not None:
        values["width"], values["length"] = body.width_m or body.length_m, body.length_m
        values["heightMin"] = values["heightMax"] = body.height_m + body.ground_clearance_m
    return values


def _geometry(settings: Settings | None) -> dict[str, Any]:
    """The driven wheels, at the ends of the axle."""
    if settings is None:
        return {}
    half_m = settings.chassis.track_width_m / 2
    width_m = settings.body.wheel_width_m if settings.body else 0.0
    return {
        "wheelDefinitions": [
            {
                "type": "DRIVE",
                "isActiveDriven": True,
                "isActiveSteered": False,
                "position": {"x": 0.0, "y": half_m if wheel.side == "left" else -half_m},
                "diameter": 2 * wheel.radius_m,
                "width": width_m,
            }
            for wheel in settings.chassis.wheels
        ]
    }


def _action(name: str) -> dict[str, Any]:
    row = ACTIONS[name]
    return {
        "actionType": name,
        "actionDescription": row.description,
        "actionScopes": list(row.scopes),
        "actionParameters": [
            {
                "key": one.key,
                "valueDataType": one.kind,
                "description": one.description or one.key,
                "isOptional": one.optional,
            }
            for one in row.parameters
            if one.key not in UNUSED
        ],
        "blockingTypes": list(row.blocking_types),
        "pauseAllowed": "false",  # words, and no booleans: so the schema of 3.0 has them
        "cancelAllowed": "true",
    }
