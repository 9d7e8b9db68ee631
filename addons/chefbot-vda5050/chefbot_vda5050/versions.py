"""What each version calls the fields and values of the records in ``messages``, and how it arranges them.

A record says everything in the names of version 2.1 (camelCase). A field or a value that all versions call the same is
not listed. What is read is brought into those names, and what is written into those of its version; nothing else knows
versions, but for the names of errors (``problems``). Source: sections 6.6 to 6.15 of 2.1.0, 6.1 to 7.10 of 3.0.0.
"""

import re
from functools import cache
from typing import Any, Final

import msgspec
from msgspec import Struct

# here: (2.1, 3.0); None: this version has no such field
FIELDS: Final[dict[str, tuple[str | None, str | None]]] = {
    "actionDescription": ("actionDescription", "actionDescriptor"),
    "agvPosition": ("agvPosition", "mobileRobotPosition"),
    "batteryCharge": ("batteryCharge", "stateOfCharge"),
    "batteryState": ("batteryState", "powerSupply"),
    "eStop": ("eStop", "activeEmergencyStop"),
    "edgeDescription": ("edgeDescription", "edgeDescriptor"),
    "endNodeId": ("endNodeId", None),
    "infoDescription": ("infoDescription", "infoDescriptor"),
    "instantActionStates": (None, "instantActionStates"),
    "intermediatePath": (None, "intermediatePath"),
    "mapDescription": ("mapDescription", None),
    "maxHeight": ("maxHeight", "maximumMobileRobotHeight"),
    "maxSpeed": ("maxSpeed", "maximumSpeed"),
    "minHeight": ("minHeight", "minimumLoadHandlingDeviceHeight"),
    "nodeDescription": ("nodeDescription", "nodeDescriptor"),
    "plannedPath": (None, "plannedPath"),
    "positionInitialized": ("positionInitialized", "localized"),
    "reach": ("reach", "range"),
    "reachOrientationBeforeEntering": (None, "reachOrientationBeforeEntering"),
    "referenceStateHeaderId": (None, "referenceStateHeaderId"),
    "resultDescription": ("resultDescription", "actionResult"),
    "retriable": (None, "retriable"),
    "rotationAllowed": ("rotationAllowed", None),
    "startNodeId": ("startNodeId", None),
    "zoneSetId": ("zoneSetId", None),
}

OF_FACTSHEET: Final[dict[str, tuple[str | None, str | None]]] = {
    "accelerationMax": ("accelerationMax", "maximumAcceleration"),
    "agvActions": ("agvActions", "mobileRobotActions"),
    "agvClass": ("agvClass", "mobileRobotClass"),
    "agvGeometry": ("agvGeometry", "mobileRobotGeometry"),
    "agvKinematic": ("agvKinematic", "mobileRobotKinematics"),
    "angularSpeedMax": ("angularSpeedMax", "maximumAngularSpeed"),
    "blockingTypes": (None, "blockingTypes"),  # the schema of 2.1 allows no list there
    "cancelAllowed": (None, "cancelAllowed"),
    "decelerationMax": ("decelerationMax", "maximumDeceleration"),
    "heightMax": ("heightMax", "maximumHeight"),
    "heightMin": ("heightMin", "minimumHeight"),
    "idLen": ("idLen", "maximumIdLength"),
    "maxArrayLens": ("maxArrayLens", "maximumArrayLengths"),
    "maxLoadMass": ("maxLoadMass", "maximumLoadMass"),
    "maxStringLens": ("maxStringLens", "maximumStringLengths"),
    "msgLen": ("msgLen", "maximumMessageLength"),
    "minOrderInterval": ("minOrderInterval", "minimumOrderInterval"),
    "minStateInterval": ("minStateInterval", "minimumStateInterval"),
    "pauseAllowed": (None, "pauseAllowed"),
    "speedMax": ("speedMax", "maximumSpeed"),
    "speedMin": ("speedMin", "minimumSpeed"),
    "supportedZones": (None, "supportedZones"),
    "vehicleConfig": ("vehicleConfig", "mobileRobotConfiguration"),
}

# of a field, here: (2.1, 3.0); None: this version has no such value
VALUES: Final[dict[str, dict[str, tuple[str | None, str | None]]]] = {
    "actionStatus": {"RETRIABLE": (None, "RETRIABLE")},
    "actionType": {"initPosition": ("initPosition", "initializePosition")},
    "agvKinematic": {
        "DIFF": ("DIFF", "DIFFERENTIAL"),
        "OMNI": ("OMNI", "OMNIDIRECTIONAL"),
        "THREEWHEEL": ("THREEWHEEL", "THREE_WHEEL"),
    },
    "blockingType": {"SINGLE": (None, "SINGLE")},
    "connectionState": {
        "CONNECTIONBROKEN": ("CONNECTIONBROKEN", "CONNECTION_BROKEN"),
        "HIBERNATING": (None, "HIBERNATING"),
    },
    "eStop": {"AUTOACK": ("AUTOACK", None)},
    "errorLevel": {"URGENT": (None, "URGENT"), "CRITICAL": (None, "CRITICAL")},
    "navigationTypes": {"AUTONOMOUS": ("AUTONOMOUS", "FREELY_NAVIGATING")},
    "operatingMode": {
        "STARTUP": (None, "STARTUP"),
        "INTERVENED": (None, "INTERVENED"),
        "TEACHIN": ("TEACHIN", "TEACH_IN"),
    },
    "valueDataType": {"FLOAT": ("FLOAT", "NUMBER")},
}

INSTEAD: Final = {
    "AUTOACK": "REMOTE",
    "CRITICAL": "WARNING",
    "HIBERNATING": "OFFLINE",
    "INTERVENED": "MANUAL",
    "RETRIABLE": "RUNNING",
    "SINGLE": "HARD",
    "STARTUP": "SERVICE",
    "URGENT": "WARNING",
}
"""What is written in a version that has no such value."""

FREE: Final = frozenset({"value"})
"""Fields in which anything may stand: nothing in them is renamed."""

Names = dict[str, str | None]


class Table(Struct, frozen=True):
    """What fields are called elsewhere, and their values by the field; None: there is no such one."""

    fields: Names
    values: dict[str, Names]


class Version:
    """One version. ``interface`` and ``major`` are the first levels of its topics, where nothing else is agreed on."""

    number, interface, major, column = "2.1.0", "uagv", "v2", 0

    def write(self, message: Struct) -> Any:
        """A record as this version has it, for JSON."""
        kind, content = type(message).__name__, msgspec.to_builtins(message)
        self._arrange(kind, content)
        return _renamed(content, self._written(kind == "Factsheet"))

    def read(self, content: Any, kind: str) -> Any:
        """What came in this version, as the record of this kind has it; a null is a field that is left out."""
        content = _renamed(content, self._as_read(kind == "Factsheet"), is_read=True)
        if isinstance(content, dict):
            self._rearrange(kind, content)
        return content

    def in_words(self, text: str) -> str:
        """A sentence with the names that fields and actions have in this version."""
        table = self._written(False)
        names = table.fields | table.values["actionType"]
        return re.sub(r"\b[a-z]+[A-Z]\w*", lambda word: names.get(word[0]) or word[0], text)

    def _arrange(self, kind: str, content: dict[str, Any]) -> None:
        """Bring into the form of this version what its names alone do not."""
        if kind == "State":
            content["actionStates"] = [*content["actionStates"], *content.pop("instantActionStates", ())]

    def _rearrange(self, kind: str, content: dict[str, Any]) -> None:
        """Undo ``_arrange`` in what came."""

    @cache  # noqa: B019 - there is one of each version
    def _written(self, is_factsheet: bool) -> Table:
        fields = OF_FACTSHEET if is_factsheet else FIELDS
        return Table(
            {here: row[self.column] for here, row in fields.items()},
            {name: {here: row[self.column] for here, row in table.items()} for name, table in VALUES.items()},
        )

    @cache  # noqa: B019 - there is one of each version
    def _as_read(self, is_factsheet: bool) -> Table:
        written = self._written(is_factsheet)
        values = {written.fields.get(name) or name: _inverse(row) for name, row in written.values.items()}
        return Table(_inverse(written.fields), values)


class Version3(Version):
    """Version 3.0: ellipses about nodes, edges without the names of their ends, instant actions by themselves."""

    number, interface, major, column = "3.0.0", "vda5050", "v3", 1

    def _arrange(self, kind: str, content: dict[str, Any]) -> None:
        if kind == "Order":
            for position in _positions(content):
                if (radius_m := position.get(DEVIATION)) is not None:
                    position[DEVIATION] = {"a": radius_m, "b": radius_m, "theta": 0.0}
        elif kind == "State":
            content.setdefault("instantActionStates", [])
            for error in content["errors"]:
                self._say_in_words(error)
        elif kind == "Factsheet":
            for one in content["protocolFeatures"]["optionalParameters"]:
                one["parameter"] = self.in_words(one["parameter"])
            kind_of_drive = content["typeSpecification"][
                "agvKinematic"
            ]  # its schema wants it by another name, too
            content["typeSpecification"]["mobileRobotKinematic"] = kind_of_drive

    def _say_in_words(self, error: dict[str, Any]) -> None:
        for key in ("errorDescription", "errorHint"):
            if key in error:
                error[key] = self.in_words(error[key])
        for reference in error.get("errorReferences", ()):
            if reference["referenceKey"] == "field":
                reference["referenceValue"] = self.in_words(reference["referenceValue"])

    def _rearrange(self, kind: str, content: dict[str, Any]) -> None:
        if kind != "Order":
            return
        for index, position in enumerate(_positions(content)):
            if DEVIATION in position:
                position[DEVIATION] = _smaller_axis(position[DEVIATION], index)
        nodes, edges = content.get("nodes"), content.get("edges")
        if isinstance(nodes, list) and isinstance(edges, list):
            ids = [node.get("nodeId", "") if isinstance(node, dict) else "" for node in nodes]
            for edge, start, end in zip(edges, ids, ids[1:], strict=False):
                if isinstance(edge, dict):  # the sequence tells what an edge connects (6.1.1)
                    edge |= {"startNodeId": start, "endNodeId": end}
            for edge in edges[max(0, len(ids) - 1) :]:
                if isinstance(edge, dict):
                    edge |= {"startNodeId": "", "endNodeId": ""}


DEVIATION: Final = "allowedDeviationXY"


def _positions(order: dict[str, Any]) -> list[dict[str, Any]]:
    """Of each node, in turn; empty where it has none."""
    nodes = order.get("nodes")
    found = [
        node.get("nodePosition") if isinstance(node, dict) else None
        for node in (nodes if isinstance(nodes, list | tuple) else ())
    ]
    return [one if isinstance(one, dict) else {} for one in found]


def _smaller_axis(ellipse: Any, index: int) -> float:
    parts = [ellipse.get(name) for name in ("a", "b", "theta")] if isinstance(ellipse, dict) else []
    numbers = [one for one in parts if isinstance(one, int | float) and not isinstance(one, bool)]
    if len(numbers) == 3:
        return min(numbers[:2])
    where = f"$.nodes[{index}].nodePosition.{DEVIATION}"
    raise msgspec.ValidationError(f"Expected an ellipse with the numbers a, b and theta - at `{where}`")


V2, V3 = Version(), Version3()
NUMBERS: Final = ("2.0.0", "2.1.0", "3.0.0")
"""That a message may name; 2.0 is read and written as 2.1."""


def of(number: str) -> Version:
    """The version of which a message says this number."""
    return V3 if number.startswith("3.") else V2


def of_message(content: Any) -> Version:
    """The version that a message names; 2.1 where it names none."""
    number = content.get("version") if isinstance(content, dict) else None
    return of(number) if isinstance(number, str) else V2


def _inverse(names: Names) -> Names:
    """From the wire to here; what this version calls otherwise, or has not, is none of its names."""
    others: Names = {here: None for here, wire in names.items() if wire != here}
    return others | {wire: here for here, wire in names.items() if wire not in (None, here)}


def _renamed(content: Any, table: Table, field: str = "", *, is_read: bool = False) -> Any:
    if isinstance(content, dict):
        fields = table.fields
        return {
            name: one if key in FREE else _renamed(one, table, key, is_read=is_read)
            for key, one in content.items()
            if one is not None and (name := fields.get(key, key)) is not None
        }
    if isinstance(content, list | tuple):
        return [_renamed(one, table, field, is_read=is_read) for one in content]
    if field in table.values and isinstance(content, str):
        value = table.values[field].get(content, content)
        return value or (f"{content} of another version" if is_read else INSTEAD[content])
    return content
